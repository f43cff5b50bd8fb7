"""Fig. 5 with autofocus shows both methods of its sweep and says which motion is tolerated."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.figures import FIGURES, autofocus

LEVELS = [0.0, 0.5, 1.0, 2.0]


@pytest.fixture
def made(make_sweep):
    over = {
        "autofocus.method": ["none", "echoes"],
        "motion.channels": ["common", "independent"],
        "motion.axis": ["x", "y"],
        "motion.level_wavelengths": LEVELS,
    }
    std = np.full((2, 2, 2, 4), 0.02)
    # Lines that rise from 2 cm; with autofocus along x alone.
    std[0] *= 1 + 0.2 * np.array(LEVELS)
    std[1, :, 0] *= 1 + 0.4 * np.array(LEVELS)
    sweep = make_sweep(over, std, realizations=2)
    sweep["std"].values[:] = std[..., None, None]
    return {"sweeps/autofocus": sweep}


def test_both_methods_are_drawn(made, draw, lines_of, check_readable, study):
    figure = draw("fig5_autofocus", made, study)
    check_readable(figure)
    std = 100 * made["sweeps/autofocus"]["std"].sel(region="whole_scene").mean("realization")
    for axes, mode in zip(figure.axes, ("common", "independent"), strict=False):
        part = std.sel(motion_channels=mode, motion_axis="y")
        np.testing.assert_allclose(
            lines_of(axes)["along y (ahead)"].get_ydata(), part.sel(autofocus_method="echoes")
        )
        dotted = [line.get_ydata() for line in axes.lines if line.get_linestyle() == ":"]
        np.testing.assert_allclose(dotted[1], part.sel(autofocus_method="none"))
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()


def test_the_tolerated_motion_is_where_the_spread_has_grown_by_its_share(made, study):
    found = autofocus.tolerated(made)
    # 1 + 0.2 l reaches 1.3 at l = 1.5, 1 + 0.4 l at 0.75, and the constant never.
    assert found["none", "common", "y"] == pytest.approx(1.5)
    assert found["echoes", "common", "x"] == pytest.approx(0.75)
    assert found["echoes", "independent", "y"] == np.inf
    said = FIGURES["fig5_autofocus"].numbers(made, study)
    assert "common along y 1.5 as recorded, 2 and more with autofocus" in said
