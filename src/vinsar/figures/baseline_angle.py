"""What errors of the baseline do to the height, by its attitude."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, style, sweeps, thumbnails
from vinsar.radar import geometry, instrument

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

    Floats = NDArray[np.floating]


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw what errors of the baseline do to the height, by its attitude.

    Parameters
    ----------
    products
        ``baseline_angle``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    product = products["baseline_angle"]
    beta = np.rad2deg(product["baseline_angle"].values)
    antenna, _ = instrument.Instrument.planned(study.radar).separated
    look = float(np.rad2deg(geometry.look_angle(antenna, *instrument.middle(study.scene))))
    figure = style.new_figure(style.TWO_COLUMNS_MM, 71.0)
    bottom, tall = 16.5, 48.0
    length, angle = float(product["length_error"]), np.rad2deg(float(product["angle_error"]))
    drawn: dict[str, Any] = {
        "color": style.INK,
        "linestyle": "none",
        "marker": "o",
        "markersize": 2.6,
    }
    drawn |= {"markerfacecolor": "none", "markeredgewidth": 0.6, "label": "drawn, exact inversion"}

    axes = style.place(figure, 13.0, bottom, 76.0, tall)
    curves = {
        "length_exact": (style.BLUE, "-", "exact derivative"),
        "length_eq5": (style.ORANGE, "--", "Eq. 5"),
    }
    for name, (colour, line, label) in curves.items():
        axes.plot(beta, 1000 * product[name].values, color=colour, linestyle=line, label=label)
    markers = axes.plot(beta, 1000 * product["length_drawn"].values, **drawn)
    limits = sweeps.around(1000 * product["length_drawn"].values, low=0.6, high=1.6)
    sweeps.log_y(axes, limits)
    axes.set_title(f"(a) error of the length, std {1000 * length:g} mm")
    axes.set_ylabel("height std (mm)")
    handles, _ = axes.get_legend_handles_labels()

    flat = style.place(figure, 101.0, bottom, 75.0, tall)
    line12 = flat.plot(
        beta,
        1000 * product["angle_eq12"].values,
        color=style.ORANGE,
        linestyle=style.DASH_DOTTED,
        label="Eq. 12",
    )
    flat.plot(beta, 1000 * product["angle_drawn"].values, **drawn)
    top = 1000 * max(float(product["angle_drawn"].max()), float(product["angle_eq12"].max()))
    flat.set_ylim(0, 1.3 * top)
    flat.yaxis.set_major_locator(style.round_ticks(6))
    flat.set_title(f"(b) error of the attitude, std {angle:.2g}°")
    for panel in (axes, flat):
        panel.set_xlim(beta[0], beta[-1])
        panel.set_xticks(np.arange(0, 91, 15))
        panel.set_xlabel(r"attitude $\beta$ of the baseline, 90 is vertical (deg)")
        mark = panel.axvline(
            look,
            color=style.GREY,
            linewidth=0.8,
            linestyle=":",
            zorder=0.5,
            label=rf"$\beta = \theta$ = {look:.2f}°",
        )
    order = [markers[0], *(handle for handle in handles if handle is not markers[0])]
    sweeps.legend(figure, [*order, line12[0], mark], 13.0, 2.5, 5)
    return figure


def numbers(products: Products, study: Study) -> str:
    """Return the height errors at the study's attitude, and where a length error is harmless."""
    product = products["baseline_angle"]
    beta = np.rad2deg(product["baseline_angle"].values)
    own = float(np.clip(study.radar.baseline_angle_deg, beta[0], beta[-1]))
    length, angle = (
        1000 * float(np.interp(own, beta, product[name].values))
        for name in ("length_drawn", "angle_drawn")
    )
    least = float(beta[int(np.argmin(product["length_exact"].values))])
    antenna, _ = instrument.Instrument.planned(study.radar).separated
    look = np.degrees(geometry.look_angle(antenna, *instrument.middle(study.scene)))
    return (
        f"At {own:g}° the errors of length and attitude give {length:.2f} and {angle:.2f} mm. A "
        f"length error does least harm at {least:g}°; θ is {look:.2f}°."
    )


def _sensitivity(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    axes.semilogy(product["baseline_angle"].values, product["length_drawn"].values, color=style.INK)


FIGURES = {
    "baseline_angle": declaration.Figure(
        draw=draw,
        title="Attitude of the baseline",
        caption=(
            "Standard deviation of the height at the scene's centre under drawn errors of the "
            "baseline's length (a) and attitude (b), by the exact inversion, against Eq. 5, "
            "the exact derivative and Eq. 12. Eq. 5 is a plane wave's: it lacks a term sin θ / "
            "cos(β - θ), so the attitude at which a length error does no harm lies asin(B / r) "
            "below the look angle."
        ),
        sections=("figures", "radar", "scene"),
        inputs=("baseline_angle",),
        numbers=numbers,
    ),
}

THUMBNAILS = {
    "baseline_angle": thumbnails.Thumbnail("height error by the baseline's attitude", _sensitivity),
}
