"""Fig. 3: the chain from scene to reconstructed height, as one sheet and as single panels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, maps, style, thumbnails
from vinsar.processing.classification import VALID

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products
    from vinsar.study.options import Figures

_HEIGHT_STEP_M = 0.05
# Facets along the longer side of the surface; more are too small to tell apart on paper.
_SURFACE_CELLS = 90
_SURFACE_HEIGHT_SHARE = 0.4
_LEAST_SURFACE_MM = 34.0
_TITLE_MM = 7.0
_FAILED_PERCENT = 0.1


@dataclass(frozen=True)
class Panel:
    """A panel of Fig. 3: its title, the product it shows, and how."""

    title: str
    product: str
    layer: Callable[[Products, Study], maps.Layer]


def height_limits(heights: xr.Dataset, outside_percent: float = 0.0) -> tuple[float, float]:
    """Return the limits of the height colours, of truth and reconstruction alike.

    Parameters
    ----------
    heights
        Product ``truth`` or, where none is known, ``dem``.
    outside_percent
        Share of the heights that may lie beyond either limit: a few failed cells must not flatten
        the colours of all others.

    Returns
    -------
    tuple of float
        The range of the heights, rounded outwards to 5 cm and at least 10 cm wide, m.
    """
    known = heights["height"].values[np.isfinite(heights["height"].values)]
    ends = np.percentile(known, [outside_percent, 100 - outside_percent]) if known.size else (0, 0)
    low = np.floor(round(float(ends[0]) / _HEIGHT_STEP_M, 6)) * _HEIGHT_STEP_M
    high = np.ceil(round(float(ends[1]) / _HEIGHT_STEP_M, 6)) * _HEIGHT_STEP_M
    if high - low < 2 * _HEIGHT_STEP_M:
        low, high = low - _HEIGHT_STEP_M, high + _HEIGHT_STEP_M
    return float(low), float(high)


def _height(data: xr.DataArray, products: Products, study: Study) -> maps.Layer:
    if "truth" in products:
        limits = height_limits(products["truth"])
    else:
        limits = height_limits(products["dem"], _FAILED_PERCENT)
    return maps.Layer(
        data,
        style.colormap(study.figures.height_colormap, "figures.height_colormap"),
        limits,
        "height (m)",
        maps.beyond(data.values, limits),
    )


def _true_height(products: Products, study: Study) -> maps.Layer:
    return _height(products["truth"]["height"], products, study)


def _reconstructed_height(products: Products, study: Study) -> maps.Layer:
    return _height(products["dem"]["height"], products, study)


def _reflectivity(products: Products, study: Study) -> maps.Layer:
    del study
    data = products["truth"]["reflectivity"]
    top = float(np.nanmax(data.values))
    return maps.Layer(data, style.colormap("magma"), (0.0, top or 1.0), "reflectivity")


def amplitude(channel: str, products: Products, study: Study) -> maps.Layer:
    """Return an image in dB below the brightest pixel of all channels, as a map shows it."""
    images = abs(products["images"]["image"])
    # One reference for both channels, so that their grey levels compare.
    top = max(float(images.max()), np.finfo(np.float32).tiny)
    image = images.sel(channel=channel)
    data = image.copy(data=20 * np.log10(np.maximum(image.values / top, 1e-20)))
    limits = (-study.figures.amplitude_range_db, 0.0)
    return maps.Layer(
        data, style.colormap("gray"), limits, "amplitude (dB)", maps.beyond(data.values, limits)
    )


def _wrapped_phase(product: str, products: Products, study: Study) -> maps.Layer:
    field = products[product]["interferogram"]
    return maps.Layer(
        field.copy(data=np.angle(field.values)),
        style.colormap(study.figures.phase_colormap, "figures.phase_colormap"),
        (-np.pi, np.pi),
        "phase (rad)",
        phase=True,
    )


def _unwrapped_phase(products: Products, study: Study) -> maps.Layer:
    del study
    data = products["unwrapped"]["phase"]
    known = data.values[np.isfinite(data.values)]
    # A few failed cells must not flatten the colours of all others.
    ends = [_FAILED_PERCENT, 100 - _FAILED_PERCENT]
    low, high = np.percentile(known, ends) / (np.pi / 2) if known.size else (-2.0, 2.0)
    first, last = int(np.floor(low)), int(np.ceil(high))
    limits = (first * np.pi / 2, max(last, first + 1) * np.pi / 2)
    return maps.Layer(
        data,
        # The phase falls as the height rises (Eq. 1): reversed, high ground looks bright.
        style.colormap("viridis_r"),
        limits,
        "phase (rad)",
        maps.beyond(data.values, limits),
        phase=True,
    )


PANELS: dict[str, Panel] = {
    "a": Panel("true height", "terrain", _true_height),
    "b": Panel("reflectivity (RCS)", "truth", _reflectivity),
    "c": Panel("image, lower antenna", "images", partial(amplitude, "lower")),
    "d": Panel("image, upper antenna", "images", partial(amplitude, "upper")),
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
def draw_sheet(products: Products, study: Study) -> Figure:
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
    left, bottom, pitch, width = 12.5, 15.0, 56.0, 38.0
    _, height = maps.fit(products["truth"]["height"], width, 60)
    # Rows from the top; only the first has the surface, which needs some height.
    heights = (max(height, _LEAST_SURFACE_MM), height, height)
    bottoms = [bottom + sum(heights[row + 1 :]) + _TITLE_MM * (2 - row) for row in range(3)]
    figure = style.new_figure(style.TWO_COLUMNS_MM, bottoms[0] + heights[0] + _TITLE_MM)
    # The surface takes the first of nine places, then the eight maps follow by row.
    _surface(figure, (2, bottoms[0], 50, heights[0]), products, study, "(a) ")
    shaded = False
    for place, letter in enumerate(PANELS, start=1):
        row, column = divmod(place, 3)
        box = (left + column * pitch, bottoms[row], width, heights[row])
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
def draw_single(letter: str, products: Products, study: Study) -> Figure:
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
    left, bottom, width = 13.0, 14.0, 57.0
    _, height = maps.fit(products["truth"]["height"], width, 75)
    surface = 52.0 if letter == "a" else 0.0
    figure = style.new_figure(style.ONE_COLUMN_MM, bottom + height + _TITLE_MM + surface)
    if surface:
        _surface(
            figure,
            (left, bottom + height + _TITLE_MM, 66, surface - _TITLE_MM),
            products,
            study,
            "",
        )
    if _map(figure, (left, bottom, width, height), letter, products, study):
        maps.explain_shadow(figure, left, 1.5, maps.SHADOW_LABEL)
    return figure


def _map(
    figure: Figure,
    box: tuple[float, float, float, float],
    letter: str,
    products: Products,
    study: Study,
    *,
    prefix: str = "",
    label_x: bool = True,
    label_y: bool = True,
) -> bool:
    """Draw a panel's map in a box (left, bottom, width, height), mm; return if it has shadow."""
    title = f"{prefix}{PANELS[letter].title}{' (map)' if letter == 'a' else ''}"
    layer = PANELS[letter].layer(products, study)
    axes = maps.draw_layer(figure, box, layer, title, label_x=label_x, label_y=label_y)
    if letter == "h":
        maps.hatch(axes, withheld(products["dem"]))
    return maps.outline_shadow(axes, products["truth"]["shadow"])


def withheld(dem: xr.Dataset) -> xr.DataArray:
    """Return where a DEM has heights that are not valid.

    Parameters
    ----------
    dem
        Product ``dem``.
    """
    return (dem["height_class"] != VALID) & np.isfinite(dem["height"])


def _surface(
    figure: Figure,
    box: tuple[float, float, float, float],
    products: Products,
    study: Study,
    prefix: str,
) -> None:
    """Draw the true terrain as a surface, seen from the vehicle's side of the scene."""
    from matplotlib.colors import LightSource, Normalize

    height = products["terrain"]["height"]
    step = max(1, -(-max(height.shape) // _SURFACE_CELLS))
    height = height[::step, ::step]
    limits = height_limits(products["truth"])
    extent = {axis: float(height[axis][-1] - height[axis][0]) for axis in ("x", "y")}
    side = np.sqrt(extent["x"] * extent["y"])
    exaggeration = max(1, round(_SURFACE_HEIGHT_SHARE * side / (limits[1] - limits[0])))

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
        (extent["x"], extent["y"], exaggeration * (limits[1] - limits[0])), zoom=1.02
    )
    axes.set_zlim(*limits)
    axes.view_init(elev=38, azim=-62)
    shares = (extent["x"] / max(extent.values()), extent["y"] / max(extent.values()), 0.6)
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), shares, strict=True):
        axis.set_pane_color("white")
        axis.line.set_linewidth(0.6)
        axis.set_major_locator(style.round_ticks(round(4 * share)))
        axis.labelpad = -6
    axes.tick_params(pad=-3)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    title = f"{prefix}true height (m), vertical × {exaggeration}"
    style.write_title(figure, box[0], box[1] + box[3], title)


def numbers(products: Products, study: Study) -> str:
    """Return the share of shadow and the number of residues, as a sentence."""
    del study
    shadow = 100 * float(products["truth"]["shadow"].mean())
    residues = int(np.count_nonzero(products["unwrapped"]["residue"].values))
    return f"{shadow:.1f} % of the cells are in shadow; the filtered phase has {residues} residues."


def _heights(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    thumbnails.heights(axes, product["height"], options)


def _facets(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    x, y, _ = product["facet_position"].values.T
    colours = product["reflectivity"].values
    axes.scatter(x, y, c=colours, cmap="gray", s=0.15, linewidths=0)
    axes.set_facecolor("black")
    axes.set_aspect("equal")
    axes.set_xlim(x.min(), x.max())
    axes.set_ylim(y.min(), y.max())


def _shadow(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    thumbnails.raster(axes, product["visible_fraction"].mean("channel"), "gray", 0, 1)


def _image(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    low = -options.amplitude_range_db
    axes.imshow(thumbnails.decibels(product["image"].values[0]), cmap="gray", vmin=low, vmax=0)


def _phase(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    angle = product["interferogram"].copy(data=np.angle(product["interferogram"].values))
    thumbnails.raster(axes, angle, style.colormap(options.phase_colormap), -np.pi, np.pi)


def _unwrapped(axes: Axes, product: xr.Dataset, options: Figures) -> None:
    del options
    low, high = thumbnails.ends(product["phase"].values)
    thumbnails.raster(axes, product["phase"], style.colormap("viridis_r"), low, high)


FIGURES = {
    "fig3": declaration.Figure(
        draw=draw_sheet,
        title="From terrain to height",
        caption=(
            "The chain: true terrain and reflectivity, the two images, raw, filtered and "
            "unwrapped phase, and the reconstructed height. Shadow is outlined."
        ),
        sections=("figures",),
        inputs=SHEET_INPUTS,
        numbers=numbers,
    ),
} | {
    f"fig3{letter}": declaration.Figure(
        draw=partial(draw_single, letter),
        title=panel.title[0].upper() + panel.title[1:],
        caption="A single panel of Figure 3.",
        sections=("figures",),
        inputs=panel_inputs(letter),
        sheet="fig3",
    )
    for letter, panel in PANELS.items()
}

THUMBNAILS = {
    "elevation": thumbnails.Thumbnail("terrain from a file", _heights),
    "roughness": thumbnails.Thumbnail("small relief of the ground", _heights),
    "terrain": thumbnails.Thumbnail("true height, as a raster", _heights),
    "facets": thumbnails.Thumbnail("point scatterers and their reflectivity", _facets),
    "truth": thumbnails.Thumbnail("share of positions that see the ground", _shadow),
    "images": thumbnails.Thumbnail("image of the lower antenna", _image),
    "interferogram": thumbnails.Thumbnail("phase between the images", _phase),
    "filtered": thumbnails.Thumbnail("filtered phase", _phase),
    "unwrapped": thumbnails.Thumbnail("unwrapped phase", _unwrapped),
    "dem": thumbnails.Thumbnail("reconstructed height", _heights),
}
