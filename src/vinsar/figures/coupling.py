"""The coupling of transmitter and receiver, its suppression, and what that costs a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps, thumbnails
from vinsar.foundations import variables

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

    Floats = NDArray[np.floating]

_PURPLE = "#7b3294"
_LOOKS = {
    ("rectangular", "none"): sweeps.Look("as received", style.ORANGE, "-", "o"),
    ("hann", "none"): sweeps.Look("Hann window", style.BLUE, style.DASHED, "s"),
    ("rectangular", "common"): sweeps.Look(
        "common part removed", style.INK, style.DASH_DOTTED, "^"
    ),
    ("rectangular", "gate"): sweeps.Look("gate", _PURPLE, style.DOTTED, "v"),
}
_LEAST_DB = -60.0
_MATRIX_DB = 40.0


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the coupling and its suppression.

    Parameters
    ----------
    products
        ``coupling`` and ``sweeps/coupling``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    data = products["coupling"]
    figure = style.new_figure(style.TWO_COLUMNS_MM, 137.0)
    _profiles(style.place(figure, 13.0, 84.0, 163.0, 46.0), data)
    _levels(style.place(figure, 13.0, 12.0, 71.0, 54.0), products["sweeps/coupling"])
    _cost(style.place(figure, 105.0, 12.0, 71.0, 54.0), data)
    return figure


def _decibel(power: Floats, width: int) -> Floats:
    """Return a power in dB, averaged over some samples: lobes are not to fill the panel."""
    from scipy.ndimage import uniform_filter1d

    mean = uniform_filter1d(power, width, mode="nearest")
    return 10 * np.log10(np.maximum(mean, 10 ** (_LEAST_DB / 10 - 2)))


def _profiles(axes: Axes, data: xr.Dataset) -> None:
    range_ = data["slant_range"].values
    width = max(1, round(0.2 / (range_[1] - range_[0])))
    curves = [
        (data["power"].sel(weighting=weighting, suppression=method), look)
        for (weighting, method), look in _LOOKS.items()
    ]
    highest = 0.0
    for power, look in curves:
        level = _decibel(power.values, width)
        highest = max(highest, float(level.max()))
        axes.plot(range_, level, color=look.colour, linestyle=look.line, label=look.label)
    axes.plot(
        range_,
        _decibel(data["scene_power"].values, width),
        color=style.GREY,
        linewidth=2.2,
        alpha=0.55,
        zorder=0.5,
        label="without coupling",
    )
    axes.set_xlim(0, range_[-1])
    axes.set_ylim(_LEAST_DB, highest + 20)
    axes.set_xlabel("slant range (m)")
    axes.set_ylabel("power over the scene's (dB)")
    axes.set_title("(a) range profiles, mean over positions")
    axes.legend(loc="upper right", ncols=3)


def _levels(axes: Axes, sweep: xr.Dataset) -> None:
    keys = ("imaging_range_window", "suppression_method", "echo_coupling_db")
    part = variables.swept(sweep, *keys).sortby("echo_coupling_db")
    levels = part["echo_coupling_db"].values
    values = []
    for (weighting, method), look in _LOOKS.items():
        if weighting in part["imaging_range_window"] and method in part["suppression_method"]:
            case = part.sel(imaging_range_window=weighting, suppression_method=method)
            std = 100 * case["std"].sel(region="visible_ground")
            sweeps.curve(axes, levels, std, look)
            values.append(std.values)
    limits = sweeps.around(*values, high=4.0)
    sweeps.log_y(axes, limits)
    axes.xaxis.set_major_locator(style.round_ticks(8))
    axes.set_xlabel("coupling over the scene's mean power in a cell (dB)")
    axes.set_ylabel("height std, visible ground (cm)")
    axes.set_title("(b) height error by the level of the coupling")
    axes.legend(loc="upper left", ncols=2)


def _cost(axes: Axes, data: xr.Dataset) -> None:
    x, share = data["x"].values, data["common_share"].isel(channel=0)
    image = abs(data["point_image"].isel(channel=0))
    for row, (colour, line, marker) in enumerate(
        ((style.BLUE, "-", "o"), (style.ORANGE, style.DASHED, "s"))
    ):
        y = float(data["y"][row])
        axes.plot(x, 1 - share.isel(y=row), color=colour, linestyle=line)
        axes.plot(
            x,
            image.sel(suppression="common").isel(y=row),
            color=colour,
            linestyle=line,
            marker=marker,
            markersize=3,
            markerfacecolor="white",
            markeredgewidth=0.8,
            label=f"common part removed, y = {y:g} m",
        )
    axes.plot(
        x,
        image.sel(suppression="gate").mean("y"),
        color=_PURPLE,
        linestyle=style.DOTTED,
        label="gate",
    )
    axes.set_xlim(0, x[-1])
    axes.set_ylim(0, 1.12)
    axes.yaxis.set_major_locator(style.round_ticks(6))
    axes.set_xlabel("x of the target (m)")
    axes.set_ylabel("amplitude left (1)")
    axes.set_title("(c) what a point target keeps")
    axes.legend(loc="lower right")


def _matrix(name: str) -> Callable[[Axes, xr.Dataset, Figures], None]:
    """Return what draws the lower channel's positions against frequency or range."""

    def draw_matrix(axes: Axes, product: xr.Dataset, options: Figures) -> None:
        del options
        values = thumbnails.decibels(product[name].values[0])
        axes.imshow(values, cmap="gray", aspect="auto", vmin=-_MATRIX_DB, vmax=0)

    return draw_matrix


def _power(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    power = product["power"].values.reshape(-1, product.sizes["slant_range"])
    axes.semilogy(product["slant_range"].values, power.T, color=style.INK, linewidth=0.6)


FIGURES = {
    "coupling": declaration.Figure(
        draw=draw,
        title="Coupling of transmitter and receiver",
        caption=(
            "Mean power of the range profiles with coupling, without it and with its "
            "suppression; the spread of the height error on visible ground against the level of "
            "the coupling; and the share of a point target's amplitude that the suppression "
            "leaves, computed (lines) and imaged (marks)."
        ),
        sections=("figures",),
        inputs=("coupling",),
        sweeps=("coupling",),
    ),
}

THUMBNAILS = {
    "echo": thumbnails.Thumbnail("clean echo: position against frequency", _matrix("echo")),
    "received": thumbnails.Thumbnail("echo as received", _matrix("echo")),
    "profiles": thumbnails.Thumbnail("range profiles: position against range", _matrix("profile")),
    "coupling": thumbnails.Thumbnail("power over range, as received", _power),
}
