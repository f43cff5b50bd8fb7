"""Fig. 5 shows the sweep over position errors, with its references."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES, vibration


def band_of(axes, number):
    """Return lower and upper edge of one of the bands."""
    band = axes.collections[number].get_paths()[0].vertices
    count = (len(band) - 3) // 2
    return band[1 : 1 + count, 1], band[2 + count : 2 + 2 * count, 1][::-1]


def test_fig5_shows_mean_and_band_by_axis_and_mode(draw, lines_of, products, study):
    figure = draw("fig5", products, study)
    std = 100 * products["sweeps/vibration"]["std"].sel(region="whole_scene")
    for axes, mode in zip(figure.axes, ("common", "independent"), strict=False):
        lines = lines_of(axes)
        for number, (label, axis) in enumerate(
            [("error along x (the rail)", "x"), ("along y (ahead)", "y"), ("along z (up)", "z")]
        ):
            part = std.sel(motion_channels=mode, motion_axis=axis)
            np.testing.assert_allclose(lines[label].get_ydata(), part.mean("realization"))
            np.testing.assert_array_equal(
                lines[label].get_xdata(), part["motion_level_wavelengths"]
            )
            low, high = band_of(axes, number)
            np.testing.assert_allclose(low, np.percentile(part, 10, axis=-1))
            np.testing.assert_allclose(high, np.percentile(part, 90, axis=-1))
    first, second, focus = figure.axes
    assert first.get_ylim() == second.get_ylim()
    assert first.get_xscale() == "symlog"
    assert first.get_xlim()[0] < 0
    assert 0 in first.get_xticks()
    gain = products["sweeps/vibration"]["point_gain"].sel(motion_channels="common")
    np.testing.assert_allclose(
        lines_of(focus)["along y (ahead)"].get_ydata(),
        gain.sel(motion_axis="y").mean(("realization", "channel")),
    )


def test_fig5_has_the_error_free_the_level_and_the_random_height_as_references(
    draw, products, study
):
    axes = draw("fig5", products, study).axes[0]
    levels = {line.get_ydata()[0] for line in axes.lines if len(set(line.get_ydata())) == 1}
    std = products["sweeps/vibration"]["std"].sel(region="whole_scene", motion_channels="common")
    r2 = np.hypot(11.0, 2.3)
    wavelength = 299_792_458.0 / 14e9
    # Vertical: the height of ambiguity is lambda r2 / 2B.
    expected = {
        100 * float(std.sel(motion_level_wavelengths=0).mean()),
        100 * float(products["truth"]["height"].std()),
        100 * wavelength * r2 / (2 * 0.3) / np.sqrt(12),
    }
    assert sorted(levels) == pytest.approx(sorted(expected))


@pytest.mark.parametrize(
    "over",
    [
        {"motion.channels": ["common"], "motion.axis": ["y"], "motion.level_wavelengths": [0.1]},
        {
            "motion.channels": ["independent", "common"],
            "motion.axis": ["z", "x"],
            "motion.level_wavelengths": [2.0, 0.0],
            "motion.spectrum": ["white", "sinusoidal"],
        },
    ],
)
def test_fig5_takes_what_the_sweep_has(make_sweep, draw, check_readable, over, products, study):
    shape = tuple(len(values) for values in over.values())
    made = {"sweeps/vibration": make_sweep(over, np.full(shape, 0.03), realizations=1)}
    figure = draw("fig5", products | made, study)
    check_readable(figure)
    marked = [line for line in figure.axes[0].lines if line.get_marker() != "None"]
    assert len(marked) == len(over["motion.axis"])
    for line in marked:
        assert list(line.get_xdata()) == sorted(over["motion.level_wavelengths"])


def test_sweep_without_a_key_that_a_figure_needs_is_refused(make_sweep, draw, products, study):
    made = {"sweeps/vibration": make_sweep({"motion.axis": ["x", "y"]}, np.ones(2))}
    with pytest.raises(ValueError, match=r"goes over motion_axis; motion_channels, motion_level"):
        draw("fig5", products | made, study)


def test_the_caption_gives_the_worst_spread(products, study):
    worst = products["sweeps/vibration"]["std"].sel(
        region="whole_scene",
        motion_channels="independent",
        motion_axis="z",
        motion_level_wavelengths=4.0,
    )
    said = FIGURES["fig5"].numbers(products, study)
    assert f"{100 * float(worst.mean()):.1f} cm along z." in said


def test_the_focus_has_a_line_and_no_picture():
    assert vibration.THUMBNAILS["focus"].draw is None
