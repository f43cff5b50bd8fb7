"""What the figures of sweeps share: spread over realizations, reference lines, axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures.drawing import style
from vinsar.foundations.configuration import swept_section
from vinsar.prediction import design
from vinsar.radar import instrument, speckle

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study

    Floats = NDArray[np.floating]

BAND = "10–90 % of the realizations"

_BAND_COLOUR = "#cfd3d7"


@dataclass(frozen=True)
class Look:
    """How a curve looks: never by its colour alone."""

    label: str
    colour: str
    line: Any
    marker: str


WHOLE = Look("std, whole scene", style.INK, "-", "o")
VISIBLE = Look("std, visible ground", style.BLUE, style.DASHED, "s")
CORE = Look("1.48 MAD, visible ground", style.ORANGE, style.DASH_DOTTED, "^")


def spread(data: xr.DataArray) -> tuple[Floats, Floats, Floats]:
    """Return mean, 10th and 90th percentile over the realizations.

    Cases without any height are left out; where all are, the values are NaN.
    """
    values = np.moveaxis(data.values, data.dims.index("realization"), 0)
    known = np.isfinite(values).any(axis=0)
    filled = np.where(known, values, 0)
    statistics = (np.nanmean(filled, axis=0), *np.nanpercentile(filled, (10, 90), axis=0))
    mean, low, high = (np.where(known, part, np.nan) for part in statistics)
    return mean, low, high


def curve(axes: Axes, at: Floats, data: xr.DataArray, look: Look, *, scale: float = 1) -> None:
    """Draw the mean over realizations as a marked line with a band from 10 to 90 %.

    Parameters
    ----------
    axes
        Where.
    at
        Positions on the x axis.
    data
        Values over the same dimension and the realizations.
    look
        How it looks, and what the legend calls it.
    scale
        Factor on the values.
    """
    mean, low, high = (scale * part for part in spread(data))
    axes.fill_between(at, low, high, color=look.colour, alpha=0.22, linewidth=0)
    axes.plot(
        at,
        mean,
        color=look.colour,
        linestyle=look.line,
        marker=look.marker,
        markersize=3,
        markerfacecolor="white",
        markeredgewidth=0.8,
        label=look.label,
    )


def band_patch() -> Any:
    """Return the entry for the bands in a legend."""
    from matplotlib.patches import Patch

    return Patch(facecolor=_BAND_COLOUR, label=BAND)


def legend(
    figure: Figure, handles: list[Any], left_mm: float, bottom_mm: float, columns: int
) -> None:
    """Write a legend below the panels, its lower left corner at this place."""
    width, height = style.page_mm(figure)
    figure.legend(
        handles=handles,
        loc="lower left",
        ncols=columns,
        bbox_to_anchor=(left_mm / width, bottom_mm / height),
        borderpad=0,
        borderaxespad=0,
        columnspacing=1.6,
        handlelength=2.6,
    )


def log_axis(axis: Any, limits: tuple[float, float]) -> None:
    """Mark a logarithmic axis with plain numbers: 1, 2, 5 of each decade if few, else its decades.

    Parameters
    ----------
    axis
        The axis, on a logarithmic scale.
    limits
        Its ends.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    low, high = limits
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps = (1, 2, 5) if high / low < 3000 else (1,)
    within = [v for d in decades for v in d * np.array(steps) if low * 0.999 <= v <= high * 1.001]
    axis.set_major_locator(FixedLocator(within))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}"))
    axis.set_minor_locator(
        FixedLocator([v for d in decades for v in d * np.arange(2, 10) if low <= v <= high])
    )
    axis.set_minor_formatter(NullFormatter())


def log_x(axes: Axes, limits: tuple[float, float]) -> None:
    """Make the x axis logarithmic, between these ends and with plain numbers."""
    axes.set_xscale("log")
    axes.set_xlim(*limits)
    log_axis(axes.xaxis, limits)


def log_y(axes: Axes, limits: tuple[float, float]) -> None:
    """Make the y axis logarithmic, between these ends and with plain numbers."""
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    log_axis(axes.yaxis, limits)


def around(*values: Any, low: float = 0.75, high: float = 1.35) -> tuple[float, float]:
    """Return limits of a logarithmic axis around all finite positive values."""
    everything = np.concatenate([np.ravel(np.asarray(part, float)) for part in values])
    known = everything[np.isfinite(everything) & (everything > 0)]
    if known.size == 0:
        return 0.1, 1.0
    return float(known.min()) * low, float(known.max()) * high


def phase_std(
    study: Study, sweep: str, planned: instrument.Instrument, coherence: Floats
) -> tuple[Floats, Floats]:
    """Return the predicted standard deviation of the filtered phase in a sweep's cases, rad.

    Parameters
    ----------
    study
        The configuration.
    sweep
        Name of the sweep.
    planned
        The instrument.
    coherence
        Coherence in the middle of the scene.

    Returns
    -------
    tuple of ndarray
        Standard deviation, of level ground, and the Cramer-Rao bound of as many looks.
    """
    scene, imaging, options = (
        swept_section(study, sweep, name) for name in ("scene", "imaging", "filtering")
    )
    looks = design.filter_looks(
        planned, *instrument.middle(scene), coherence, options=options, imaging=imaging
    )
    return speckle.phase_std(coherence, looks), speckle.phase_bound(coherence, looks)


def draw_bound(axes: Axes, at: Floats, bound: Floats) -> Any:
    """Draw the Cramer-Rao bound of the height, cm, and return its line."""
    (line,) = axes.plot(
        at, bound, color=style.INK, linestyle=(0, (1, 1)), linewidth=0.9, label="Cramér-Rao bound"
    )
    return line
