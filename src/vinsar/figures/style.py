"""The look of all figures, kept in one place, and their layout in millimetres."""

from __future__ import annotations

import functools
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

P = ParamSpec("P")
R = TypeVar("R")

TWO_COLUMNS_MM = 180.0
ONE_COLUMN_MM = 88.0
MM_PER_INCH = 25.4

BLUE, ORANGE, GREY, INK = "#0067a5", "#d95f02", "#8a8f94", "#1a1a1a"
NO_DATA = "#c9c9c9"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.titlepad": 3,
    "axes.labelsize": 7.5,
    "axes.labelpad": 2,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 1.5,
    "ytick.minor.size": 1.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.pad": 2,
    "ytick.major.pad": 2,
    "grid.color": "#c4c7ca",
    "grid.linewidth": 0.3,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "image.origin": "lower",
    # Pixels as they are: interpolation would invent phases where the phase wraps.
    "image.interpolation": "none",
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "vinsar",
}


@contextmanager
def applied() -> Iterator[None]:
    """Apply the style within the block, whatever the user's own settings are, and undo it after."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Make a function draw in the style."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        with applied():
            return draw(*args, **kwargs)

    return wrapper


def new_figure(width_mm: float, height_mm: float) -> Figure:
    """Return an empty figure of this size, outside any graphical interface.

    Parameters
    ----------
    width_mm, height_mm
        Size on paper, mm.

    Returns
    -------
    matplotlib.figure.Figure
        The figure; fill it with `place`.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH))


def place(
    figure: Figure,
    left_mm: float,
    bottom_mm: float,
    width_mm: float,
    height_mm: float,
    **options: Any,
) -> Axes:
    """Add axes at a fixed place on the paper.

    Parameters
    ----------
    figure
        The figure.
    left_mm, bottom_mm
        Lower left corner, from that of the figure, mm.
    width_mm, height_mm
        Size, mm.
    **options
        Passed on to `matplotlib.figure.Figure.add_axes`.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.
    """
    width, height = (float(size) * MM_PER_INCH for size in figure.get_size_inches())
    box = (left_mm / width, bottom_mm / height, width_mm / width, height_mm / height)
    return figure.add_axes(box, **options)


def colormap(name: str, key: str = "colormap") -> Colormap:
    """Return a colour map by name.

    Parameters
    ----------
    name
        A map of Fabio Crameri's collection as ``cmc.<name>``, or one of Matplotlib's own.
    key
        Configuration key that holds the name, for the message.

    Returns
    -------
    matplotlib.colors.Colormap
        The map; cells without a value are grey.

    Raises
    ------
    ValueError
        If there is no such map; names `key` and the nearest known names.
    """
    import difflib

    import matplotlib

    known: Any = matplotlib.colormaps
    if name.startswith("cmc."):
        # Not by their registration with Matplotlib: whatever imported them, the answer is one.
        from cmcrameri import cm  # type: ignore[import-untyped]

        known = {f"cmc.{short}": table for short, table in cm.cmaps.items()}
    if name not in known:
        near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(near)}?" if near else "try cmc.batlow or viridis"
        raise ValueError(f"{key}: there is no colour map '{name}'; {hint}")
    return known[name].with_extremes(bad=NO_DATA)  # type: ignore[no-any-return]
