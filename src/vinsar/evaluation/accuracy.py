"""Height errors and their statistics: the whole scene, visible ground, shadow, what is delivered.

Delivered are the cells that the processing itself takes for valid. What their standard deviations
promise is held against the errors, and what they leave out against what is truly hidden.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.constants import REGIONS
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing.classification import VALID
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
    "percentile_90_absolute",
    "percentile_95_absolute",
    "maximum_absolute",
)

_SHARES = (
    "fraction_within_tolerance",
    "fraction_reconstructed",
    "coverage_1_sigma",
    "coverage_2_sigma",
    "share_of_scene",
)


VARIABLES = {
    "height_error": Variable(GRID, "real", "m", "height error, reconstructed minus true"),
    "shadow": SHADOW,
    "delivered": Variable(
        GRID,
        "flag",
        "1",
        "whether the height is delivered as valid",
        flag_meanings="withheld delivered",
    ),
    "mean": Variable(("region",), "real", "m", "mean height error"),
    "std": Variable(("region",), "real", "m", "standard deviation of the height error"),
    "median": Variable(("region",), "real", "m", "median height error"),
    "mad": Variable(("region",), "real", "m", "median absolute deviation of the height error"),
    "percentile_90_absolute": Variable(
        ("region",), "real", "m", "90th percentile of the absolute height error (LE90)"
    ),
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
    "coverage_1_sigma": Variable(
        ("region",),
        "real",
        "1",
        "share of the heights with an error within their standard deviation",
        "68.3 % of a normal distribution",
    ),
    "coverage_2_sigma": Variable(
        ("region",),
        "real",
        "1",
        "share of the heights with an error within twice their standard deviation",
        "95.4 % of a normal distribution",
    ),
    "share_of_scene": Variable(
        ("region",), "real", "1", "share of the scene's cells that are in the region"
    ),
    "hidden_delivered": Variable(
        (),
        "real",
        "1",
        "share of the hidden ground that is delivered as valid",
        "ground a cell or more inside the shadow",
    ),
    "visible_withheld": Variable(
        (), "real", "1", "share of the visible ground that is not delivered"
    ),
    "binned_std": Variable(
        ("std_bin",), "real", "m", "root mean square of the standard deviations of the bin's cells"
    ),
    "binned_error": Variable(
        ("std_bin",), "real", "m", "root mean square of the height errors of the bin's cells"
    ),
    "binned_coverage": Variable(
        ("std_bin", "sigmas"),
        "real",
        "1",
        "share of the bin's heights with an error within so many standard deviations",
    ),
    "cell_count": Variable(("region",), "integer", "1", "number of cells in the region"),
    "tolerance": Variable((), "real", "m", "height error that counts as within"),
}
"""Variables of the product ``accuracy``."""

variables.declare(
    "accuracy",
    VARIABLES,
    coordinates={
        "std_bin": Variable(
            ("std_bin",), "integer", "1", "fifth of what is delivered, by its standard deviation"
        ),
        "sigmas": Variable(("sigmas",), "integer", "1", "number of standard deviations"),
    },
    statistics=True,
)

BINS = 5
"""Parts, of as many cells each, into which what is delivered is divided by standard deviation."""

SIGMAS = (1, 2)
"""Intervals whose coverage is counted, in standard deviations."""


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
        Mean, std, median, MAD, 90th and 95th percentile and maximum of the absolute error, in
        metres, over the cells with a height; the share of cells with a height; the share of all
        cells within the tolerance (a cell without a height is not); and the number of cells. NaN
        where there is nothing to count.
    """
    known = error[np.isfinite(error)]
    absolute = np.abs(known)
    result: dict[str, float] = dict.fromkeys(_STATISTICS, np.nan)
    if known.size:
        median = np.median(known)
        near, far = np.percentile(absolute, (90, 95))
        result = {
            "mean": known.mean(),
            "std": known.std(),
            "median": median,
            "mad": np.median(np.abs(known - median)),
            "percentile_90_absolute": near,
            "percentile_95_absolute": far,
            "maximum_absolute": absolute.max(),
        }
    cells = error.size
    within = int((absolute <= tolerance_m).sum())
    result["fraction_within_tolerance"] = within / cells if cells else np.nan
    result["fraction_reconstructed"] = known.size / cells if cells else np.nan
    return {name: float(value) for name, value in result.items()} | {"cell_count": cells}


def coverage(error: NDArray[np.floating], std: NDArray[np.floating]) -> dict[str, float]:
    """Return the shares of errors within one and two of their standard deviations.

    Parameters
    ----------
    error, std
        Height errors and their standard deviations (cell,), m; NaN where there is no height.

    Returns
    -------
    dict
        Both shares of the cells with a height; NaN where there is none.
    """
    known = np.isfinite(error) & np.isfinite(std)
    ratio = np.abs(error[known]) / np.maximum(std[known], np.finfo(float).tiny)
    return {
        f"coverage_{times}_sigma": float((ratio <= times).mean()) if ratio.size else np.nan
        for times in SIGMAS
    }


def calibration(
    error: NDArray[np.floating], std: NDArray[np.floating]
) -> dict[str, NDArray[np.floating]]:
    """Return errors and standard deviations by fifths of the standard deviation.

    Parameters
    ----------
    error, std
        Height errors and their standard deviations (cell,), m; NaN where there is no height.

    Returns
    -------
    dict
        ``binned_std`` and ``binned_error`` (bin,), root mean squares in m, and ``binned_coverage``
        (bin, interval); NaN where there are fewer cells than bins.
    """
    known = np.isfinite(error) & np.isfinite(std)
    order = np.argsort(std[known], kind="stable")
    parts = np.array_split(order, BINS) if order.size >= BINS else [order[:0]] * BINS
    found = [(error[known][part], std[known][part]) for part in parts]

    def root(values: NDArray[np.floating]) -> float:
        return float(np.sqrt(np.mean(values**2))) if values.size else np.nan

    shares = [list(coverage(*pair).values()) for pair in found]
    return {
        "binned_std": np.array([root(own) for _, own in found]),
        "binned_error": np.array([root(own) for own, _ in found]),
        "binned_coverage": np.array(shares),
    }


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part[whole].mean()) if whole.any() else np.nan


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
    from scipy.ndimage import binary_erosion

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
    valid = dem["height_class"].values == VALID
    parts = {
        "whole_scene": exists,
        "visible_ground": exists & ~shadow,
        "shadow": exists & shadow,
        "delivered": exists & valid,
    }
    std = dem["height_std"].values
    rows = [
        statistics(error[parts[region]], tolerance_m)
        | coverage(error[parts[region]], std[parts[region]])
        | {"share_of_scene": _share(parts[region], exists)}
        for region in REGIONS
    ]
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    # Beyond the edge of the scene everything may be hidden.
    inside = binary_erosion(shadow, np.ones((3, 3), bool), border_value=1)
    return variables.dataset(
        "accuracy",
        {
            "height_error": error,
            "shadow": shadow,
            "delivered": parts["delivered"],
            "tolerance": tolerance_m,
            "hidden_delivered": _share(valid, inside & exists),
            "visible_withheld": _share(~valid, parts["visible_ground"]),
        }
        | calibration(error[parts["delivered"]], std[parts["delivered"]])
        | table,
        {
            "x": dem["x"].values,
            "y": dem["y"].values,
            "region": np.array(REGIONS),
            "sigmas": np.array(SIGMAS),
        },
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
        The tolerance, what is hidden and yet delivered and visible and withheld, and a dictionary
        of statistics for each region; None where undefined.
    """
    result: dict[str, Any] = {"tolerance_m": float(accuracy["tolerance"])}
    for name in ("hidden_delivered", "visible_withheld"):
        result[name] = _number(accuracy[name])
    for region in REGIONS:
        part = accuracy.sel(region=region)
        row: dict[str, Any] = {}
        for name in _STATISTICS:
            row[f"{name}_error_m"] = _number(part[name])
        for name in _SHARES:
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
