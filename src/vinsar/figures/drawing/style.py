"""The look of all figures, kept in one place, and their layout in millimetres."""

from __future__ import annotations

import functools
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

from vinsar.foundations import colormaps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.ticker import Locator

    from vinsar.study.options import Figures


P = ParamSpec("P")
R = TypeVar("R")

# The widths and the size of text for which the figures are laid out. The configuration may ask for
# others: then the layout is enlarged or reduced as a whole, and the text has the size asked for.
TWO_COLUMNS_MM = 180.0
ONE_COLUMN_MM = 88.0
FONT_SIZE_PT = 7.5
MM_PER_INCH = 25.4
TITLE_GAP_MM = 1.5

BLUE, ORANGE, GREEN, GREY, INK = "#0067a5", "#d95f02", "#1b7837", "#8a8f94", "#1a1a1a"
NO_DATA = "#c9c9c9"

DASHED, DOTTED, DASH_DOTTED = (0, (4, 1.5)), (0, (1, 1.2)), (0, (4, 1.2, 1, 1.2))

STYLE: dict[str, Any] = {
    "font.size": FONT_SIZE_PT,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.titlepad": 4.25,
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


# Both come with Matplotlib, so that figures are the same on every machine.
FONTS: dict[str, dict[str, Any]] = {
    "sans": {"font.family": "DejaVu Sans", "mathtext.fontset": "dejavusans"},
    "serif": {"font.family": "STIXGeneral", "mathtext.fontset": "stix"},
}

_IN_POINTS = tuple(key for key in STYLE if key.endswith(("size", "pad", "width")))

_options: ContextVar[Figures | None] = ContextVar("_options", default=None)
# What each figure was made with, and its size over that in the layout.
_OF_FIGURE: WeakKeyDictionary[Figure, tuple[Figures | None, float]] = WeakKeyDictionary()


@contextmanager
def applied(options: Figures | None = None) -> Iterator[None]:
    """Apply the style within the block, whatever Matplotlib's settings are, and restore them after.

    Parameters
    ----------
    options
        Widths, size of text and font; without them, those of the layout.
    """
    import matplotlib

    scale = text_scale(options)
    sizes = {key: STYLE[key] * scale for key in _IN_POINTS}
    token = _options.set(options)
    try:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            look = STYLE | sizes | FONTS["sans" if options is None else options.font]
            matplotlib.rcParams.update(look)  # type: ignore[arg-type]
            yield
    finally:
        _options.reset(token)


def text_scale(options: Figures | None) -> float:
    """Return the size of text over that of the layout."""
    return 1.0 if options is None else options.font_size_pt / FONT_SIZE_PT


def points(size: float) -> float:
    """Return a size of text, given for the layout's text of 7.5 pt, as the style has it, pt."""
    return size * text_scale(_options.get())


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Make a function draw in the style that the figures' section of its study asks for.

    The study is the function's last argument.
    """
    return _styled(draw, {})


def styled_for_slides(font_size_pt: float) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function draw in the style with text of a size of its own, for slides."""
    return functools.partial(_styled, changes={"font_size_pt": font_size_pt})


def _styled(draw: Callable[P, R], changes: dict[str, Any]) -> Callable[P, R]:
    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        study: Any = kwargs.get("study", args[-1] if args else None)
        with applied(study.figures.model_copy(update=changes)):
            return draw(*args, **kwargs)

    return wrapper


def new_figure(width_mm: float, height_mm: float) -> Figure:
    """Return an empty figure of this size, outside any graphical interface.

    Parameters
    ----------
    width_mm, height_mm
        Size in the layout, mm. A figure as wide as one or two columns becomes as wide as the
        configuration has them, and higher or lower with it.

    Returns
    -------
    matplotlib.figure.Figure
        The figure; fill it with `place`.
    """
    from matplotlib.figure import Figure

    options, scale = _options.get(), 1.0
    if options is not None:
        columns = {
            ONE_COLUMN_MM: options.one_column_mm,
            TWO_COLUMNS_MM: options.two_columns_mm,
        }
        scale = columns.get(width_mm, width_mm) / width_mm
    size = (width_mm * scale / MM_PER_INCH, height_mm * scale / MM_PER_INCH)
    figure = Figure(figsize=size)
    _OF_FIGURE[figure] = (options, scale)
    return figure


def options_of(figure: Figure) -> Figures | None:
    """Return the options that a figure was made with."""
    return _OF_FIGURE.get(figure, (None, 1.0))[0]


def page_mm(figure: Figure) -> tuple[float, float]:
    """Return the width and height of a figure in the layout, mm."""
    width, height = figure.get_size_inches()
    scale = _OF_FIGURE.get(figure, (None, 1.0))[1]
    return float(width) * MM_PER_INCH / scale, float(height) * MM_PER_INCH / scale


def size_mm(axes: Axes) -> tuple[float, float]:
    """Return the width and height of axes in the layout, mm."""
    figure: Any = axes.get_figure(root=True)
    width, height = page_mm(figure)
    box = axes.get_position()
    return width * box.width, height * box.height


def write_title(figure: Figure, left_mm: float, top_mm: float, text: str) -> None:
    """Write the title of axes whose upper left corner is at this place, mm."""
    width, height = page_mm(figure)
    figure.text(
        left_mm / width,
        (top_mm + TITLE_GAP_MM) / height,
        text,
        fontsize=points(STYLE["axes.titlesize"]),
    )


def round_ticks(most: int) -> Locator:
    """Return a choice of about so many round numbers, at least two intervals of them."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(max(2, most), steps=[1, 2, 5, 10])


def place(
    figure: Figure,
    left_mm: float,
    bottom_mm: float,
    width_mm: float,
    height_mm: float,
    **options: Any,
) -> Axes:
    """Add axes at a fixed place of the layout.

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
    width, height = page_mm(figure)
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
    try:
        found = colormaps.find(name)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    return found.with_extremes(bad=NO_DATA)
