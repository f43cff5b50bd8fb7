"""The front sheet: the whole study on one slide, to be read from the back of a room."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vinsar.figures import chain, height_error
from vinsar.figures.drawing import declaration, maps, style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

INPUTS = tuple(
    dict.fromkeys((*(name for letter in "acfh" for name in chain.panel_inputs(letter)), "accuracy"))
)
"""Products that it reads."""

# A slide of 16:9, as presentation programs have it.
_WIDTH_MM, _HEIGHT_MM = 338.7, 190.5
_FONT_SIZE_PT = 17.0
_PITCH_MM, _LEFT_MM, _MAP_MM = 109.0, 25.0, 68.0
_BOTTOMS_MM = (101.0, 18.0)
_TALL_MM = 66.0
_SHOWN = (
    ("a", "true height"),
    ("c", "image"),
    ("f", "filtered phase"),
    ("h", "reconstructed height"),
)


@style.styled_for_slides(_FONT_SIZE_PT)
def draw(products: Products, study: Study) -> Figure:
    """Draw the front sheet: scene, image, phase, reconstructed height, its error and statistics.

    Parameters
    ----------
    products
        Those of `INPUTS`.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, a slide of 16:9; its size and text are its own, whatever the journal's are.
    """
    figure = style.new_figure(_WIDTH_MM, _HEIGHT_MM)
    figure.text(
        0.5,
        1 - 8 / _HEIGHT_MM,
        title(study),
        ha="center",
        va="center",
        fontsize=style.points(8.2),
    )
    for place, (letter, name) in enumerate(_SHOWN):
        layer = chain.PANELS[letter].layer(products, study)
        hidden = chain.withheld(products["dem"]) if letter == "h" else None
        _map(figure, place, name, layer, products["truth"]["shadow"], hidden)
    accuracy = products["accuracy"]
    shaded = _map(
        figure,
        4,
        "height error",
        height_error.layer(accuracy),
        accuracy["shadow"],
        chain.withheld(products["dem"]),
    )
    if shaded:
        maps.explain_shadow(figure, _LEFT_MM + 2 * _PITCH_MM, 4.0, maps.SHADOW_LABEL)
    for row, (number, meaning) in enumerate(statistics(accuracy)):
        left = (_LEFT_MM + 2 * _PITCH_MM) / _WIDTH_MM
        level = _BOTTOMS_MM[1] + _TALL_MM - 17.5 * row
        figure.text(
            left,
            level / _HEIGHT_MM,
            number,
            va="top",
            fontsize=style.points(12),
            fontweight="bold",
            color=style.BLUE,
        )
        figure.text(left, (level - 9.5) / _HEIGHT_MM, meaning, va="top")
    return figure


def title(study: Study) -> str:
    """Return the sheet's title: the radar in a line."""
    radar = study.radar
    return (
        f"{radar.start_frequency_hz / 1e9:g} … {radar.stop_frequency_hz / 1e9:g} GHz, "
        f"aperture {radar.aperture_length_m:g} m, baseline {radar.baseline_m:g} m, "
        f"antennas {radar.rail_height_m:g} m above ground"
    )


def statistics(accuracy: xr.Dataset) -> list[tuple[str, str]]:
    """Return the statistics of the sheet, each as a number and what it is.

    Parameters
    ----------
    accuracy
        Product ``accuracy``.

    Returns
    -------
    list of tuple of str
        What is delivered and what that is worth, then the spread of all heights in centimetres.
    """
    delivered = accuracy.sel(region="delivered")
    whole = accuracy.sel(region="whole_scene")
    tolerance = 100 * float(accuracy["tolerance"])
    return [
        (
            height_error.written(100 * float(delivered["share_of_scene"]), ".1f") + " %",
            "of the scene delivered",
        ),
        (
            height_error.written(100 * float(delivered["fraction_within_tolerance"]), ".1f") + " %",
            f"of that within {tolerance:g} cm",
        ),
        (
            height_error.written(100 * float(whole["fraction_within_tolerance"]), ".1f") + " %",
            f"of the scene within {tolerance:g} cm",
        ),
        (
            height_error.written(100 * float(whole["std"]), ".1f") + " cm",
            "standard deviation",
        ),
    ]


def _map(
    figure: Figure,
    place: int,
    name: str,
    layer: maps.Layer,
    shadow: xr.DataArray,
    withheld: xr.DataArray | None = None,
) -> bool:
    """Draw a map in the place of this number, by row; return if it has shadow."""
    row, column = divmod(place, 3)
    # No wider than the map, so that its name begins where the map does.
    width, _ = maps.fit(layer.data, _MAP_MM, _TALL_MM)
    box = (_LEFT_MM + column * _PITCH_MM, _BOTTOMS_MM[row], width, _TALL_MM)
    axes = maps.draw_layer(figure, box, layer, "", label_x=row == 1, label_y=column == 0)
    figure.text(
        box[0] / _WIDTH_MM,
        (box[1] + _TALL_MM + 4) / _HEIGHT_MM,
        name,
        fontsize=style.points(8),
        fontweight="bold",
    )
    if withheld is not None:
        maps.hatch(axes, withheld)
    return maps.outline_shadow(axes, shadow)


FIGURES = {
    "summary": declaration.Figure(
        draw=draw,
        title="Front sheet",
        caption=(
            "The study on one sheet: true height, image of the lower antenna, filtered phase, "
            "reconstructed height, its error, and the error's statistics. Heights that are not "
            "delivered are hatched."
        ),
        sections=("figures", "radar"),
        inputs=INPUTS,
        numbers=height_error.numbers,
    ),
}
