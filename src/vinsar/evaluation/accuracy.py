"""Height errors and their statistics, for the whole scene, visible ground and shadow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import REGIONS
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.simulation.visibility import SHADOW

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

_STATISTICS = (
    "mean",
    "std",
    "median",
    "mad",
    "percentile_95_absolute",
    "maximum_absolute",
)


VARIABLES = {
    "height_error": Variable(GRID, "real", "m", "height error, reconstructed minus true"),
    "shadow": SHADOW,
    "mean": Variable(("region",), "real", "m", "mean height error"),
    "std": Variable(("region",), "real", "m", "standard deviation of the height error"),
    "median": Variable(("region",), "real", "m", "median height error"),
    "mad": Variable(("region",), "real", "m", "median absolute deviation of the height error"),
    "percentile_95_absolute": Variable(
        ("region",), "real", "m", "95th percentile of the absolute height error"
    ),
    "maximum_absolute": Variable(("region",), "real", "m", "largest absolute height error"),
    "fraction_within_tolerance": Variable(
        ("region",),
        "real",
        "1",
        "share of the region's cells with an error within the tolerance",
    ),
    "fraction_reconstructed": Variable(
        ("region",), "real", "1", "share of the region's cells that have a height"
    ),
    "cell_count": Variable(("region",), "integer", "1", "number of cells in the region"),
    "tolerance": Variable((), "real", "m", "height error that counts as within"),
}
"""Variables of the product ``accuracy``."""

variables.declare("accuracy", VARIABLES)


class Accuracy(Section, name="accuracy"):
    """What the height errors are held against."""

    tolerance_m: float = key("height error that counts as within", "section 2.3", gt=0)


def statistics(error: NDArray[np.floating], tolerance_m: float) -> dict[str, float]:
    """Return the statistics of the errors of one region.

    Parameters
    ----------
    error
        Height errors (cell,), m; NaN where there is no height.
    tolerance_m
        Error that counts as within, m.

    Returns
    -------
    dict
        Mean, std, median, MAD, 95th percentile and maximum of the absolute error, in metres, over
        the cells with a height; the share of cells with a height; the share of all cells within
        the tolerance (a cell without a height is not); and the number of cells. NaN where there is
        nothing to count.
    """
    known = error[np.isfinite(error)]
    absolute = np.abs(known)
    result: dict[str, float] = dict.fromkeys(_STATISTICS, np.nan)
    if known.size:
        median = np.median(known)
        result = {
            "mean": known.mean(),
            "std": known.std(),
            "median": median,
            "mad": np.median(np.abs(known - median)),
            "percentile_95_absolute": np.percentile(absolute, 95),
            "maximum_absolute": absolute.max(),
        }
    cells = error.size
    within = int((absolute <= tolerance_m).sum())
    result["fraction_within_tolerance"] = within / cells if cells else np.nan
    result["fraction_reconstructed"] = known.size / cells if cells else np.nan
    return {name: float(value) for name, value in result.items()} | {"cell_count": cells}


def evaluate(dem: xr.Dataset, truth: xr.Dataset, *, tolerance_m: float) -> xr.Dataset:
    """Hold a DEM against the true terrain.

    Parameters
    ----------
    dem, truth
        Products of these names, on one grid. Cells outside the true terrain do not count.
    tolerance_m
        Error that counts as within, m.

    Returns
    -------
    xarray.Dataset
        Product ``accuracy``.

    Raises
    ------
    ValueError
        If the grids differ.
    """
    for axis in ("x", "y"):
        ours, theirs = dem[axis].values, truth[axis].values
        if ours.shape != theirs.shape or not np.allclose(ours, theirs, rtol=0, atol=1e-9):
            raise ValueError(
                f"the DEM's {axis} runs from {ours[0]:g} to {ours[-1]:g} m in {ours.size} cells, "
                f"the truth's from {theirs[0]:g} to {theirs[-1]:g} m in {theirs.size}"
            )
    error = dem["height"].values - truth["height"].values
    shadow = truth["shadow"].values
    exists = np.isfinite(truth["height"].values)
    parts = {"whole_scene": exists, "visible_ground": exists & ~shadow, "shadow": exists & shadow}
    rows = [statistics(error[parts[region]], tolerance_m) for region in REGIONS]
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return variables.dataset(
        "accuracy",
        {"height_error": error, "shadow": shadow, "tolerance": tolerance_m} | table,
        {"x": dem["x"].values, "y": dem["y"].values, "region": np.array(REGIONS)},
    )


def summary(accuracy: xr.Dataset) -> dict[str, Any]:
    """Return the statistics as a plain dictionary with units in its keys, for JSON.

    Parameters
    ----------
    accuracy
        Product ``accuracy``.

    Returns
    -------
    dict
        The tolerance, and a dictionary of statistics for each region; None where undefined.
    """
    result: dict[str, Any] = {"tolerance_m": float(accuracy["tolerance"])}
    for region in REGIONS:
        part = accuracy.sel(region=region)
        row: dict[str, Any] = {}
        for name in _STATISTICS:
            row[f"{name}_error_m"] = _number(part[name])
        for name in ("fraction_within_tolerance", "fraction_reconstructed"):
            row[name] = _number(part[name])
        row["cell_count"] = int(part["cell_count"])
        result[region] = row
    return result


def _number(value: xr.DataArray) -> float | None:
    return float(value) if np.isfinite(value) else None


def _accuracy(products: Products, study: Study) -> xr.Dataset:
    return evaluate(products["dem"], products["truth"], tolerance_m=study.accuracy.tolerance_m)


STAGES = {
    "accuracy": Stage(_accuracy, inputs=("dem", "truth"), sections=("accuracy",)),
}
