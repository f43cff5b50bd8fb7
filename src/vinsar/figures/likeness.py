"""The published figures beside those that each open choice gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures.drawing import declaration, style
from vinsar.paper import likeness

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_PANELS = (
    ("within 5 cm (%)", 100.0),
    ("std (cm)", 100.0),
    ("worst (m)", 1.0),
)
_LEFT_MM, _WIDTH_MM, _GAP_MM = 76.0, 22.5, 4.0
_ROW_MM, _TOP_MM, _BOTTOM_MM = 3.4, 9.0, 15.0


def _choices(products: Products) -> list[likeness.Choice]:
    prefix = "sweeps/"
    sweeps = {
        name.removeprefix(prefix): data
        for name, data in products.items()
        if name.startswith(prefix)
    }
    return likeness.compare(sweeps)


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw share, spread and worst error of each choice, and its distance, by rows.

    Parameters
    ----------
    products
        The sweeps over open choices, as ``sweeps/<name>``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    choices = _choices(products)
    height = _ROW_MM * len(choices)
    figure = style.new_figure(style.TWO_COLUMNS_MM, height + _TOP_MM + _BOTTOM_MM)
    at = -np.arange(len(choices))
    values = np.array([choice.values for choice in choices])
    for number, (label, scale) in enumerate(_PANELS):
        left = _LEFT_MM + number * (_WIDTH_MM + _GAP_MM)
        axes = style.place(figure, left, _BOTTOM_MM, _WIDTH_MM, height)
        part = scale * values[..., number]
        spread = part.std(axis=1, ddof=1)
        # Choices without heights leave a gap.
        for centre, wide, row, choice in zip(part.mean(axis=1), spread, at, choices, strict=True):
            like = abs(choice.deviations[number]) <= 2
            axes.errorbar(
                centre,
                row,
                xerr=2 * wide,
                color=style.BLUE if like else style.GREY,
                marker="o" if like else "s",
                markersize=2.6,
                linewidth=0.8,
                markerfacecolor="white",
            )
        axes.axvline(
            scale * likeness.PUBLISHED[number], color=style.ORANGE, linestyle="--", linewidth=0.9
        )
        _rows(axes, at, [choice.label for choice in choices] if number == 0 else [])
        axes.set_xlabel(label)
        axes.xaxis.set_major_locator(style.round_ticks(3))
    axes = style.place(figure, _LEFT_MM + 3 * (_WIDTH_MM + _GAP_MM), _BOTTOM_MM, _WIDTH_MM, height)
    axes.errorbar(
        [choice.distance for choice in choices],
        at,
        xerr=[choice.distance_std for choice in choices],
        color=style.INK,
        linestyle="none",
        marker="o",
        markersize=2.6,
        linewidth=0.8,
    )
    axes.set_xlim(left=0)
    _rows(axes, at, [])
    axes.set_xlabel("distance (std)")
    style.write_title(
        figure, 3.0, height + _TOP_MM + _BOTTOM_MM - 4.5, "Open choices beside the paper's figures"
    )
    return figure


def _rows(axes: object, at: object, labels: list[str]) -> None:
    axes.set_yticks(at, labels or [""] * len(at))  # type: ignore[attr-defined,arg-type]
    axes.tick_params(axis="y", labelsize="small")  # type: ignore[attr-defined]
    axes.set_ylim(at[-1] - 0.7, 0.7)  # type: ignore[attr-defined,index]
    axes.grid(axis="y", linewidth=0.3)  # type: ignore[attr-defined]


def numbers(products: Products, study: Study) -> str:
    """Return the conclusion."""
    del study
    return likeness.conclusion(_choices(products))


FIGURES = {
    "likeness": declaration.Figure(
        draw=draw,
        title="Which choices give the paper's figures",
        caption=(
            "Share of heights within 5 cm, standard deviation, worst error (whole scene), and "
            "their joint distance from the published figures (dashed), for choices that the paper "
            "leaves open. Bars: two standard deviations of a realization; of the distance, its "
            "own. Blue circles: the published figure is within them; grey squares: not."
        ),
        sections=("figures",),
        sweeps=likeness.SWEEPS,
        numbers=numbers,
    ),
}
