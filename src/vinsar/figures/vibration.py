"""Fig. 5: the height under position errors along three axes, and the focus that they leave."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps, thumbnails
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section
from vinsar.radar import instrument

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

LOOKS = {
    "x": sweeps.Look("error along x (the rail)", style.BLUE, "-", "o"),
    "y": sweeps.Look("along y (ahead)", style.ORANGE, style.DASHED, "s"),
    "z": sweeps.Look("along z (up)", style.INK, style.DASH_DOTTED, "^"),
}
MODES = {"common": "(a) common to both antennas", "independent": "(b) independent"}
_HEIGHT_MM = 79.0
_LEFTS, _BOTTOM, _WIDTH, _TALL = (12.0, 69.0, 131.0), 21.0, 46.0, 52.0


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw Fig. 5.

    Parameters
    ----------
    products
        ``sweeps/vibration`` and ``truth``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    sweep = variables.swept(
        products["sweeps/vibration"], "motion_channels", "motion_axis", "motion_level_wavelengths"
    )
    deviation = sweep["std"].sel(region="whole_scene")
    relief = float(products["truth"]["height"].std())
    radar = swept_section(study, "vibration", "radar")
    place = instrument.middle(swept_section(study, "vibration", "scene"))
    random = float(instrument.Instrument.planned(radar).random_phase_std(*place))
    figure = style.new_figure(style.TWO_COLUMNS_MM, _HEIGHT_MM)
    # One scale for both panels: they are to be compared.
    limits = sweeps.around(100 * deviation.values, [100 * relief, 100 * random])
    modes = [mode for mode in MODES if mode in sweep["motion_channels"].values]
    handles: list[Any] = []
    for mode, left in zip(modes, _LEFTS, strict=False):
        axes = style.place(figure, left, _BOTTOM, _WIDTH, _TALL)
        part = deviation.sel(motion_channels=mode)
        _heights(axes, part, limits)
        handles = _references(axes, part, relief, random)
        axes.set_title(MODES[mode])
        if left == _LEFTS[0]:
            axes.set_ylabel("height std, whole scene (cm)")
    axes = style.place(figure, _LEFTS[2], _BOTTOM, _WIDTH, _TALL)
    _focus(axes, sweep["point_gain"].sel(motion_channels=modes[0]))
    curves, _ = axes.get_legend_handles_labels()
    sweeps.legend(figure, [*curves, sweeps.band_patch(), *handles], 8.0, 2.0, 4)
    return figure


def mark_levels(axes: Axes, levels: Any) -> None:
    """Scale the x axis: logarithmic above the lowest level, and with a place for zero."""
    from matplotlib.ticker import FixedLocator, FuncFormatter

    positive = levels[levels > 0]
    least = float(positive.min()) if positive.size else 1.0
    axes.set_xscale("symlog", linthresh=least, linscale=0.6)
    decades = [10.0**n for n in range(-6, 4)]
    marks = [0.0, *(v for v in decades if least <= v <= levels.max())]
    axes.xaxis.set_major_locator(FixedLocator(marks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}"))
    axes.xaxis.set_minor_locator(
        FixedLocator([v * n for v in decades for n in range(2, 10) if least <= v * n])
    )
    axes.set_xlim(-0.2 * least, 1.25 * max(float(levels.max()), least))
    axes.set_xlabel("level: std of the error (wavelengths)")


def axes_of(data: xr.DataArray | xr.Dataset) -> list[str]:
    """Return the axes of the errors that a sweep has, in the order of their looks."""
    return [name for name in LOOKS if name in data["motion_axis"].values]


def _heights(axes: Axes, deviation: xr.DataArray, limits: tuple[float, float]) -> None:
    ordered = deviation.sortby("motion_level_wavelengths")
    levels = ordered["motion_level_wavelengths"].values
    for name in axes_of(ordered):
        sweeps.curve(axes, levels, ordered.sel(motion_axis=name), LOOKS[name], scale=100)
    sweeps.log_y(axes, limits)
    mark_levels(axes, levels)


def _references(axes: Axes, deviation: xr.DataArray, relief: float, random: float) -> list[Any]:
    none = deviation.sel(motion_level_wavelengths=deviation["motion_level_wavelengths"] == 0)
    lines = []
    if none.size:
        floor = 100 * float(none.mean())
        lines.append((floor, f"no error: {floor:.1f} cm", "-"))
    lines += [
        (100 * relief, f"level DEM: {100 * relief:.1f} cm", "--"),
        (100 * random, f"random phase: {100 * random:.1f} cm", ":"),
    ]
    return [
        axes.axhline(at, label=text, color=style.GREY, linestyle=line, linewidth=0.9, zorder=0.5)
        for at, text, line in lines
    ]


def _focus(axes: Axes, gain: xr.DataArray) -> None:
    # Both antennas lose focus alike: their errors have one distribution.
    ordered = gain.sortby("motion_level_wavelengths").mean("channel")
    levels = ordered["motion_level_wavelengths"].values
    for name in axes_of(ordered):
        sweeps.curve(axes, levels, ordered.sel(motion_axis=name), LOOKS[name])
    axes.set_ylim(0, 1.05)
    axes.yaxis.set_major_locator(style.round_ticks(6))
    axes.set_ylabel("amplitude left (1)")
    axes.set_title("(c) focus of a point target")
    mark_levels(axes, levels)


def numbers(products: Products, study: Study) -> str:
    """Return the spreads at about a tenth of a wavelength and at the highest level."""
    del study
    sweep = variables.swept(
        products["sweeps/vibration"], "motion_channels", "motion_axis", "motion_level_wavelengths"
    )
    levels = np.sort(sweep["motion_level_wavelengths"].values)
    shown = sorted({float(levels[np.searchsorted(levels, 0.1).clip(max=levels.size - 1)]),
                    float(levels[-1])})  # fmt: skip
    parts = []
    for channels in sweep["motion_channels"].values:
        for level in shown:
            part = sweep["std"].sel(
                region="whole_scene", motion_channels=channels, motion_level_wavelengths=level
            )
            values = ", ".join(
                f"{100 * float(sweeps.spread(part.sel(motion_axis=axis))[0]):.1f} cm along {axis}"
                for axis in sorted(sweep["motion_axis"].values)
            )
            parts.append(f"{channels} errors of {level:g} wavelengths: {values}")
    return f"Mean spread under {'; '.join(parts)}."


FIGURES = {
    "fig5": declaration.Figure(
        draw=draw,
        title="Position errors",
        caption=(
            "Standard deviation of the height error over the whole scene against position "
            "errors along three axes, common to both antennas as in the paper and independent, "
            "and what they leave of a point target. Lines are means and bands 10 to 90 % of "
            "the realizations. Grey: without errors; a DEM of level ground, whose error is the "
            "relief itself; and a phase that is uniformly random, the height of ambiguity at "
            "the scene's centre over the root of 12. Heights can be worse than that where "
            "unwrapping adds whole cycles."
        ),
        sections=("figures", "radar", "scene", "sweeps"),
        inputs=("truth",),
        sweeps=("vibration",),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "focus": thumbnails.Thumbnail("what position errors leave of a point target"),
}
