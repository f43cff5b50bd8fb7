"""The spread of the height over the length of the baseline and the position errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import declaration, maps, style, sweeps
from vinsar.foundations import variables
from vinsar.foundations.configuration import swept_section

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]

_CONTOURS_CM = (3, 5, 10, 20, 50)
_MODES = {"common": "errors common to both antennas", "independent": "independent errors"}


@style.styled
def draw(products: Products, study: Study) -> Figure:
    """Draw the spread of the height over the length of the baseline and the vibration.

    Parameters
    ----------
    products
        ``sweeps/baseline_vibration``.
    study
        The configuration.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    sweep = variables.swept(
        products["sweeps/baseline_vibration"],
        "motion_channels",
        "radar_baseline_m",
        "motion_level_wavelengths",
    ).sortby(["radar_baseline_m", "motion_level_wavelengths"])
    axis = swept_section(study, "baseline_vibration", "motion").axis
    modes = [mode for mode in _MODES if mode in sweep["motion_channels"].values]
    part = (
        sweep["std"]
        .sel(region="whole_scene")
        .transpose("motion_channels", "radar_baseline_m", "motion_level_wavelengths", "realization")
    )
    fields = {m: 100 * sweeps.spread(part.sel(motion_channels=m))[0] for m in modes}
    limits = sweeps.around(*fields.values(), low=1, high=1.0001)
    figure = style.new_figure(style.TWO_COLUMNS_MM, 74.0)
    for number, (mode, left) in enumerate(zip(modes, (13.0, 90.0), strict=False)):
        axes = style.place(figure, left, 13.0, 70.0, 54.0)
        image = _heat(axes, part, fields[mode], limits)
        axes.set_title(f"({'ab'[number]}) {_MODES[mode]}, along {axis}")
        axes.set_xlabel("level: std of the error (wavelengths)")
        axes.tick_params(labelleft=number == 0)
        if number == 0:
            axes.set_ylabel("baseline B (m)")
    bar = maps.colorbar(axes, image, "height std, whole scene (cm)")
    sweeps.log_axis(bar.ax.yaxis, limits)
    return figure


def _heat(axes: Axes, part: xr.DataArray, field: Floats, limits: tuple[float, float]) -> Any:
    """Draw a field as even cells, whatever the steps between the values, with its contours."""
    from matplotlib import patheffects
    from matplotlib.colors import LogNorm

    rows, columns = field.shape
    image = axes.pcolormesh(
        np.arange(columns + 1) - 0.5,
        np.arange(rows + 1) - 0.5,
        field,
        norm=LogNorm(*limits),
        cmap=style.colormap("cmc.batlow"),
        rasterized=True,
    )
    inside = [level for level in _CONTOURS_CM if np.nanmin(field) < level < np.nanmax(field)]
    if inside and min(field.shape) > 1:
        casing: list[Any] = [patheffects.withStroke(linewidth=1.6, foreground="black")]
        lines = axes.contour(field, levels=inside, colors="white", linewidths=0.8)
        lines.set_path_effects(casing)
        texts = axes.clabel(lines, fmt="%g cm", fontsize=style.points(7), inline_spacing=3)
        for text in texts:
            text.set_path_effects(casing)
    names = ("motion_level_wavelengths", "radar_baseline_m")
    for axis, name in zip((axes.xaxis, axes.yaxis), names, strict=True):
        values = part[name].values
        axis.set_ticks(np.arange(values.size), [f"{value:g}" for value in values])
    return image


def numbers(products: Products, study: Study) -> str:
    """Return the best case of each kind of error at the highest level, as a sentence."""
    del study
    sweep = variables.swept(
        products["sweeps/baseline_vibration"],
        "motion_channels",
        "radar_baseline_m",
        "motion_level_wavelengths",
    )
    level = float(sweep["motion_level_wavelengths"].max())
    parts = []
    for channels in sweep["motion_channels"].values:
        part = sweep["std"].sel(
            region="whole_scene", motion_channels=channels, motion_level_wavelengths=level
        )
        mean = sweeps.spread(part.transpose("radar_baseline_m", "realization"))[0]
        at = float(sweep["radar_baseline_m"].values[int(np.nanargmin(mean))])
        parts.append(f"{100 * float(np.nanmin(mean)):.1f} cm at {at:g} m under {channels} errors")
    return f"At {level:g} wavelengths the least spread is {' and '.join(parts)}."


FIGURES = {
    "baseline_vibration": declaration.Figure(
        draw=draw,
        title="Length of the baseline under position errors",
        caption=(
            "Standard deviation of the height error over the whole scene, by the length of the "
            "baseline and the level of white position errors, common to both antennas and "
            "independent. The cells are the cases; contours run between their centres."
        ),
        sections=("figures", "motion", "sweeps"),
        sweeps=("baseline_vibration",),
        numbers=numbers,
    ),
}
