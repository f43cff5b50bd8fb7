"""Fig. 3: the chain from the scene to the reconstructed height, as one sheet and as single panels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import maps, style

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

    from vinsar import config
    from vinsar.pipeline import Products

_HEIGHT_STEP_M = 0.05
# Facets along the longer side of the surface; more are too small to tell apart on paper.
_SURFACE_CELLS = 90
_SURFACE_HEIGHT_SHARE = 0.4


@dataclass(frozen=True)
class Layer:
    """What a map shows: values, colours, and the colour bar that explains them."""

    data: xr.DataArray
    colormap: Colormap
    limits: tuple[float, float]
    label: str
    extend: maps.Extend = "neither"
    ticks: Sequence[float] | None = None
    tick_labels: Sequence[str] | None = None


@dataclass(frozen=True)
class Panel:
    """A panel of Fig. 3: its title, the product it shows, and how."""

    title: str
    product: str
    layer: Callable[[Products, config.Study], Layer]


def height_limits(truth: xr.Dataset) -> tuple[float, float]:
    """Return the limits of the height colours, of truth and reconstruction alike.

    Parameters
    ----------
    truth
        Product ``truth``.

    Returns
    -------
    tuple of float
        The range of the true heights, rounded outwards to 5 cm and at least 10 cm wide, m.
    """
    heights = truth["height"].values
    low = np.floor(round(float(np.nanmin(heights)) / _HEIGHT_STEP_M, 6)) * _HEIGHT_STEP_M
    high = np.ceil(round(float(np.nanmax(heights)) / _HEIGHT_STEP_M, 6)) * _HEIGHT_STEP_M
    if high - low < 2 * _HEIGHT_STEP_M:
        low, high = low - _HEIGHT_STEP_M, high + _HEIGHT_STEP_M
    return float(low), float(high)


def pi_label(halves: int) -> str:
    """Return how a phase of so many halves of pi is written."""
    sign = "−" if halves < 0 else ""
    whole, odd = divmod(abs(halves), 2)
    if odd:
        return f"{sign}{'' if abs(halves) == 1 else abs(halves)}π/2"
    return "0" if whole == 0 else f"{sign}{'' if whole == 1 else whole}π"


def _height(data: xr.DataArray, products: Products, study: config.Study) -> Layer:
    limits = height_limits(products["truth"])
    return Layer(
        data,
        style.colormap(study.figures.height_colormap, "figures.height_colormap"),
        limits,
        "height (m)",
        maps.beyond(data.values, limits),
    )


def _true_height(products: Products, study: config.Study) -> Layer:
    return _height(products["truth"]["height"], products, study)


def _reconstructed_height(products: Products, study: config.Study) -> Layer:
    return _height(products["dem"]["height"], products, study)


def _reflectivity(products: Products, study: config.Study) -> Layer:
    del study
    data = products["truth"]["reflectivity"]
    top = float(np.nanmax(data.values))
    return Layer(data, style.colormap("magma"), (0.0, top or 1.0), "reflectivity")


def _amplitude(channel: str, products: Products, study: config.Study) -> Layer:
    amplitude = np.abs(products["images"]["image"])
    # One reference for both channels, so that their grey levels compare.
    top = max(float(amplitude.max()), np.finfo(np.float32).tiny)
    data = 20 * np.log10(np.maximum(amplitude.sel(channel=channel) / top, 1e-20))
    limits = (-study.figures.amplitude_range_db, 0.0)
    return Layer(
        data, style.colormap("gray"), limits, "amplitude (dB)", maps.beyond(data.values, limits)
    )


def _wrapped_phase(product: str, products: Products, study: config.Study) -> Layer:
    field = products[product]["interferogram"]
    return Layer(
        field.copy(data=np.angle(field.values)),
        style.colormap(study.figures.phase_colormap, "figures.phase_colormap"),
        (-np.pi, np.pi),
        "phase (rad)",
        ticks=(-np.pi, 0.0, np.pi),
        tick_labels=("−π", "0", "π"),
    )


def _unwrapped_phase(products: Products, study: config.Study) -> Layer:
    del study
    data = products["unwrapped"]["phase"]
    # A few failed cells must not flatten the colours of all others.
    low, high = np.nanpercentile(data.values, [0.1, 99.9]) / (np.pi / 2)
    first, last = int(np.floor(low)), int(np.ceil(high))
    last = max(last, first + 1)
    limits = (first * np.pi / 2, last * np.pi / 2)
    step = next(step for step in (1, 2, 4, 10, 20, 40, 100, 200, 10**6) if last - first <= 7 * step)
    halves = [n for n in range(first, last + 1) if n % step == 0]
    return Layer(
        data,
        # The phase falls as the height rises (Eq. 1): reversed, high ground looks bright.
        style.colormap("viridis_r"),
        limits,
        "phase (rad)",
        maps.beyond(data.values, limits),
        [n * np.pi / 2 for n in halves],
        [pi_label(n) for n in halves],
    )


PANELS: dict[str, Panel] = {
    "a": Panel("true height", "terrain", _true_height),
    "b": Panel("reflectivity (RCS)", "truth", _reflectivity),
    "c": Panel("image, lower antenna", "images", partial(_amplitude, "lower")),
    "d": Panel("image, upper antenna", "images", partial(_amplitude, "upper")),
    "e": Panel("raw phase", "interferogram", partial(_wrapped_phase, "interferogram")),
    "f": Panel("filtered phase", "filtered", partial(_wrapped_phase, "filtered")),
    "g": Panel("unwrapped phase", "unwrapped", _unwrapped_phase),
    "h": Panel("reconstructed height", "dem", _reconstructed_height),
}
"""The paper's eight panels; (a) is a surface and a map."""


def panel_inputs(letter: str) -> tuple[str, ...]:
    """Return the products that a panel reads: its own, and the truth for the shadow's outline."""
    return tuple(dict.fromkeys((PANELS[letter].product, "truth")))


SHEET_INPUTS: tuple[str, ...] = tuple(
    dict.fromkeys(product for letter in PANELS for product in panel_inputs(letter))
)


@style.styled
def draw_sheet(products: Products, study: config.Study) -> Figure:
    """Draw Fig. 3 as one sheet.

    Parameters
    ----------
    products
        Those of `SHEET_INPUTS`.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    truth = products["truth"]
    left, bottom, pitch = 10.5, 15.0, 57.0
    width, height = maps.fit(truth["height"], 39.5, 60)
    row_pitch = height + 7
    figure = style.new_figure(style.TWO_COLUMNS_MM, bottom + 3 * row_pitch)
    # The surface takes the first of nine places, then the eight maps follow by row.
    _surface(figure, (1, bottom + 2 * row_pitch, 52, height), products, study, "(a) ")
    shaded = False
    for place, letter in enumerate(PANELS, start=1):
        row, column = divmod(place, 3)
        box = (left + column * pitch, bottom + (2 - row) * row_pitch, width, height)
        shaded |= _map(
            figure,
            box,
            letter,
            products,
            study,
            prefix=f"({letter}) ",
            label_x=row == 2,
            label_y=column == 0 or letter == "a",
        )
    if shaded:
        maps.explain_shadow(
            figure,
            left,
            2,
            f"{maps.SHADOW_LABEL}: cells hidden from either antenna at more than half of its "
            "positions",
        )
    return figure


@style.styled
def draw_single(letter: str, products: Products, study: config.Study) -> Figure:
    """Draw one panel of Fig. 3 as a figure of its own.

    Parameters
    ----------
    letter
        A key of `PANELS`.
    products
        Those of `panel_inputs`.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    left, bottom = 11.0, 14.0
    width, height = maps.fit(products["truth"]["height"], 60, 75)
    surface = 52.0 if letter == "a" else 0.0
    figure = style.new_figure(style.ONE_COLUMN_MM, bottom + height + 7 + surface)
    if surface:
        _surface(figure, (4, bottom + height + 8, 80, surface - 6), products, study, "")
    left += (60 - width) / 2
    box = (left, bottom, width, height)
    if _map(figure, box, letter, products, study):
        maps.explain_shadow(figure, left, 1.5, maps.SHADOW_LABEL)
    return figure


def _map(
    figure: Figure,
    box: tuple[float, float, float, float],
    letter: str,
    products: Products,
    study: config.Study,
    *,
    prefix: str = "",
    label_x: bool = True,
    label_y: bool = True,
) -> bool:
    """Draw a panel's map in a box (left, bottom, width, height), mm; say if it has shadow."""
    panel = PANELS[letter]
    layer = panel.layer(products, study)
    axes = style.place(figure, *box)
    image = maps.draw(
        axes,
        layer.data,
        colormap=layer.colormap,
        limits=layer.limits,
        label_x=label_x,
        label_y=label_y,
    )
    axes.set_title(f"{prefix}{panel.title}{', map' if letter == 'a' else ''}")
    maps.colorbar(
        axes,
        image,
        layer.label,
        extend=layer.extend,
        ticks=layer.ticks,
        tick_labels=layer.tick_labels,
    )
    return maps.outline_shadow(axes, products["truth"]["shadow"])


def _surface(
    figure: Figure,
    box: tuple[float, float, float, float],
    products: Products,
    study: config.Study,
    prefix: str,
) -> None:
    """Draw the true terrain as a surface, seen from the vehicle's side of the scene."""
    from matplotlib.colors import LightSource, Normalize
    from matplotlib.ticker import MaxNLocator

    height = products["terrain"]["height"]
    step = max(1, -(-max(height.shape) // _SURFACE_CELLS))
    height = height[::step, ::step]
    limits = height_limits(products["truth"])
    extent = {axis: float(height[axis][-1] - height[axis][0]) for axis in ("x", "y")}
    longest = max(extent.values())
    exaggeration = max(1, round(_SURFACE_HEIGHT_SHARE * longest / (limits[1] - limits[0])))

    axes: Any = style.place(figure, *box, projection="3d", computed_zorder=False)
    colours = style.colormap(study.figures.height_colormap, "figures.height_colormap")
    faces = LightSource(azdeg=300, altdeg=50).shade(
        height.values,
        colours,
        norm=Normalize(*limits),
        blend_mode="soft",
        vert_exag=exaggeration,
        dx=extent["x"] / (height.sizes["x"] - 1),
        dy=extent["y"] / (height.sizes["y"] - 1),
    )
    x, y = np.meshgrid(height["x"].values, height["y"].values)
    surface = axes.plot_surface(
        x,
        y,
        height.values,
        rstride=1,
        cstride=1,
        facecolors=faces,
        shade=False,
        linewidth=0,
        antialiased=False,
    )
    surface.set_rasterized(True)
    axes.set_box_aspect(
        (extent["x"], extent["y"], exaggeration * (limits[1] - limits[0])), zoom=1.15
    )
    axes.set_zlim(*limits)
    axes.view_init(elev=32, azim=-62)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color("white")
        axis.line.set_linewidth(0.6)
        axis.set_major_locator(MaxNLocator(3 if axis is axes.zaxis else 5, steps=[1, 2, 5, 10]))
        axis.labelpad = -7
    axes.tick_params(pad=-3)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_zlabel("z (m)")
    width, height_mm = (float(size) * style.MM_PER_INCH for size in figure.get_size_inches())
    figure.text(
        (box[0] + 2) / width,
        (box[1] + box[3] + 1) / height_mm,
        f"{prefix}true height, z × {exaggeration}",
        fontsize=8,
    )
