"""What the heights' standard deviations and classes promise, held against the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.figures import height_error
from vinsar.figures.drawing import declaration, style
from vinsar.processing.classification import CLASSES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

# Of a normal distribution, within one and two standard deviations.
_NORMAL = (0.683, 0.954)

_LOOKS = ((style.BLUE, "o"), (style.ORANGE, "s"))


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw predicted against measured spread, the intervals' coverage, and the classes.

    Parameters
    ----------
    products
        ``accuracy``, ``dem`` and ``truth``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    del study
    accuracy = products["accuracy"]
    figure = style.new_figure(style.TWO_COLUMNS_MM, 72)
    titles = ("(a) spread of what is delivered", "(b) coverage", "(c) classes")
    for left, title in zip((13, 70, 133), titles, strict=True):
        style.write_title(figure, left, 65, title)
    _spread(style.place(figure, 13, 13, 44, 46), accuracy)
    _coverage(style.place(figure, 70, 13, 44, 46), accuracy)
    _classes(style.place(figure, 145, 13, 32, 46), products["dem"], products["truth"])
    return figure


def _spread(axes: Axes, accuracy: xr.Dataset) -> None:
    told, found = (100 * accuracy[name].values for name in ("binned_std", "binned_error"))
    known = np.isfinite(told) & np.isfinite(found)
    top = 1.15 * max(1e-6, *told[known], *found[known]) if known.any() else 1.0
    axes.plot([0, top], [0, top], color=style.GREY, linewidth=0.7)
    axes.plot(told, found, color=style.BLUE, marker="o", markersize=style.points(3))
    axes.set_xlim(0, top)
    axes.set_ylim(0, top)
    axes.set_xlabel("predicted standard deviation (cm)")
    axes.set_ylabel("root mean square error (cm)")


def _coverage(axes: Axes, accuracy: xr.Dataset) -> None:
    fifths = np.arange(accuracy.sizes["std_bin"]) + 1
    for place, (normal, (colour, marker)) in enumerate(zip(_NORMAL, _LOOKS, strict=True)):
        axes.axhline(100 * normal, color=style.GREY, linewidth=0.7)
        axes.plot(
            fifths,
            100 * accuracy["binned_coverage"].values[:, place],
            color=colour,
            marker=marker,
            markersize=style.points(3),
            label=f"within {place + 1} std",
        )
    axes.set_ylim(40, 102)
    axes.set_xticks(fifths)
    axes.set_xlabel("fifth, by predicted std")
    axes.set_ylabel("heights (%)")
    axes.legend(loc="lower right")


def confusion(dem: xr.Dataset, truth: xr.Dataset) -> NDArray[np.floating]:
    """Return the shares of visible and of hidden ground in each class.

    Parameters
    ----------
    dem, truth
        Products of these names.

    Returns
    -------
    ndarray, shape (class, 2)
        Shares of visible and of hidden ground; NaN where there is none.
    """
    kind, shadow = dem["height_class"].values, truth["shadow"].values
    exists = np.isfinite(truth["height"].values)
    result = np.full((len(CLASSES), 2), np.nan)
    for column, part in enumerate((exists & ~shadow, exists & shadow)):
        if part.any():
            result[:, column] = [np.mean(kind[part] == number) for number in range(len(CLASSES))]
    return result


def _classes(axes: Axes, dem: xr.Dataset, truth: xr.Dataset) -> None:
    shares = 100 * confusion(dem, truth)
    axes.imshow(np.nan_to_num(shares), cmap="Blues", vmin=0, vmax=100, aspect="auto")
    for row, column in np.ndindex(*shares.shape):
        value = float(shares[row, column])
        axes.text(
            column,
            row,
            height_error.written(value, ".1f"),
            ha="center",
            va="center",
            color="white" if value > 50 else style.INK,
        )
    axes.set_xticks([0, 1], ["visible", "hidden"])
    axes.set_yticks(range(len(CLASSES)), [name.replace("_", " ") for name in CLASSES])
    axes.set_xlabel("truth (% of its cells)")
    axes.tick_params(length=0)
    axes.grid(visible=False)


def numbers(products: Products, study: Study) -> str:
    """Return what is delivered and what is not, as a sentence."""
    del study
    accuracy = products["accuracy"]
    hidden, withheld = (
        height_error.written(100 * float(accuracy[name]), ".1f")
        for name in ("hidden_delivered", "visible_withheld")
    )
    return (
        f"{height_error.delivered(accuracy)} {hidden} % of the ground a cell or more inside the "
        f"shadow are delivered, {withheld} % of the visible ground are not."
    )


FIGURES = {
    "calibration": declaration.Figure(
        draw=draw,
        title="What the standard deviations and classes of the heights are worth",
        caption=(
            "(a) Measured against predicted spread of the heights delivered, by fifths of the "
            "predicted standard deviation; (b) share of the errors within one and two of it, with "
            "those of a normal distribution; (c) what visible and hidden ground are taken for."
        ),
        inputs=("accuracy", "dem", "truth"),
        sections=("figures",),
        numbers=numbers,
    )
}
