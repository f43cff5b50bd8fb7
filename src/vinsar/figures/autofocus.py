"""Fig. 5 with autofocus: the height under position errors that the echoes correct."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import vibration
from vinsar.figures.drawing import declaration, style, sweeps, thumbnails
from vinsar.foundations import variables
from vinsar.radar import motion

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_HEIGHT_MM = 79.0
_LEFTS, _BOTTOM, _WIDTH, _TALL = (12.0, 69.0, 131.0), 21.0, 46.0, 52.0

TOLERATED = 1.3
"""Growth of the spread over that without errors up to which a level counts as tolerated."""


def _swept(products: Products) -> xr.Dataset:
    return variables.swept(
        products["sweeps/autofocus"],
        "autofocus_method",
        "motion_channels",
        "motion_axis",
        "motion_level_wavelengths",
    ).sortby("motion_level_wavelengths")


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the spread of the heights with autofocus, and faintly without.

    Parameters
    ----------
    products
        ``sweeps/autofocus``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    sweep = _swept(products)
    deviation = sweep["std"].sel(region="whole_scene")
    levels = sweep["motion_level_wavelengths"].values
    figure = style.new_figure(style.TWO_COLUMNS_MM, _HEIGHT_MM)
    limits = sweeps.around(100 * deviation.values)
    modes = [mode for mode in vibration.MODES if mode in sweep["motion_channels"].values]
    names = vibration.axes_of(sweep)
    for mode, left in zip(modes, _LEFTS, strict=False):
        axes = style.place(figure, left, _BOTTOM, _WIDTH, _TALL)
        for name in names:
            part = deviation.sel(motion_channels=mode, motion_axis=name)
            look = vibration.LOOKS[name]
            without = sweeps.spread(part.sel(autofocus_method="none"))[0]
            axes.plot(levels, 100 * without, color=look.colour, linestyle=":", linewidth=0.9)
            sweeps.curve(axes, levels, part.sel(autofocus_method="echoes"), look, scale=100)
        sweeps.log_y(axes, limits)
        vibration.mark_levels(axes, levels)
        axes.set_title(vibration.MODES[mode])
        if left == _LEFTS[0]:
            axes.set_ylabel("height std, whole scene (cm)")
    axes = style.place(figure, _LEFTS[2], _BOTTOM, _WIDTH, _TALL)
    gain = sweep["peak_gain"].sel(motion_channels=modes[0]).mean("channel")
    for name in names:
        part = gain.sel(motion_axis=name, autofocus_method="echoes")
        sweeps.curve(axes, levels, part, vibration.LOOKS[name])
    axes.set_ylim(0, 1.05)
    axes.yaxis.set_major_locator(style.round_ticks(6))
    axes.set_ylabel("amplitude left (1)")
    axes.set_title("(c) focus of a point target")
    vibration.mark_levels(axes, levels)
    curves, _ = axes.get_legend_handles_labels()
    sweeps.legend(figure, [*curves, sweeps.band_patch(), _without()], 8.0, 2.0, 4)
    return figure


def _without() -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], color=style.GREY, linestyle=":", linewidth=0.9, label="as recorded")


def tolerated(products: Products) -> dict[tuple[str, str, str], float]:
    """Return the tolerated level, in wavelengths, by method, mode and axis.

    Up to it the spread stays below `TOLERATED` times that without errors; infinite where it does
    so at all levels of the sweep.
    """
    sweep = _swept(products)
    deviation = sweep["std"].sel(region="whole_scene")
    levels = sweep["motion_level_wavelengths"].values
    return {
        (method, mode, axis): motion.sufficient_error(
            levels,
            sweeps.spread(
                deviation.sel(autofocus_method=method, motion_channels=mode, motion_axis=axis)
            )[0],
            factor=TOLERATED,
        )
        for method in ("none", "echoes")
        for mode in sweep["motion_channels"].values
        for axis in sorted(sweep["motion_axis"].values)
    }


def numbers(products: Products, study: Study) -> str:
    """Return the motion that is tolerated as recorded and with autofocus."""
    del study
    highest = float(products["sweeps/autofocus"]["motion_level_wavelengths"].max())
    found = tolerated(products)

    def level(value: float) -> str:
        return f"{value:.2g}" if np.isfinite(value) else f"{highest:g} and more"

    parts = [
        f"{mode} along {axis} {level(found['none', mode, axis])} as recorded, {level(value)} with "
        "autofocus"
        for (method, mode, axis), value in found.items()
        if method == "echoes"
    ]
    return (
        f"Errors that let the spread grow by {TOLERATED - 1:.0%} at most, in wavelengths: "
        f"{'; '.join(parts)}."
    )


FIGURES = {
    "fig5_autofocus": declaration.Figure(
        draw=draw,
        title="Position errors taken from the echoes",
        caption=(
            "Figure 5 with autofocus: standard deviation of the height error over the whole scene "
            "against position errors along three axes, common to both antennas and independent, "
            "when imaging takes the recorded positions as the echoes correct them, and dotted as "
            "they are recorded; and what the corrected positions leave of a point target, where "
            "its image lies. Lines are means and bands 10 to 90 % of the realizations."
        ),
        sections=("figures",),
        sweeps=("autofocus",),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "autofocus": thumbnails.Thumbnail("what the echoes correct of the recorded positions"),
}
