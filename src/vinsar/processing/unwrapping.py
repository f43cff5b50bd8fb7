"""Phase unwrapping: four published solvers behind one function, and the residues."""

from __future__ import annotations

import importlib.util
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import cycles, interferogram, masks, phases

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]
    Flags = NDArray[np.bool_]

_NO_SNAPHU = (
    "snaphu is not installed, as its solver is free for non-commercial use only; install it into "
    ".venv with pip (package `snaphu`), or take `unwrapping.method: whirlwind`"
)

variables.declare(
    "unwrapped",
    {
        "phase": Variable(
            GRID,
            "real",
            "radian",
            "unwrapped interferometric phase without the flat-earth phase",
            "lower minus upper; known up to one constant",
        ),
        "residue": Variable(
            GRID,
            "integer",
            "1",
            "residue of the filtered phase",
            "winding number of the four cells whose least x and y are this one's: -1, 0 or 1",
            bounds=(-1, 1),
        ),
    },
)


def residues(phase: Floats) -> NDArray[np.int8]:
    """Return the winding number of the wrapped phase around every 2 x 2 cell.

    Parameters
    ----------
    phase
        Wrapped phase (y, x), rad.

    Returns
    -------
    ndarray of int8, shape (y, x)
        -1, 0 or 1; the last row and column, which begin no cell, hold 0, and so do cells with a
        corner that has no phase.
    """

    def turns(difference: Floats) -> Floats:
        return np.rint(difference / (2 * np.pi))

    right, up = np.diff(phase, axis=1), np.diff(phase, axis=0)
    right, up = right - 2 * np.pi * turns(right), up - 2 * np.pi * turns(up)
    result = np.zeros(phase.shape, np.int8)
    result[:-1, :-1] = np.nan_to_num(turns(right[:-1] + up[:, 1:] - right[1:] - up[:, :-1]))
    return result


@cache
def _single_thread() -> None:
    """Keep whirlwind to one thread: parallelism is Dask's."""
    import whirlwind

    # It refuses if another library or the user has decided before.
    with suppress(RuntimeError):
        whirlwind.set_num_threads(1)


def _whirlwind(values: Complexes, coherence: Floats, looks: float, known: Flags) -> Floats:
    import whirlwind

    _single_thread()
    # Low coherence rather than a mask where there is a phase: a mask would split the scene into
    # pieces of unknown level.
    unwrapped, _ = whirlwind.unwrap(
        np.ascontiguousarray(values, np.complex64),
        np.ascontiguousarray(np.maximum(coherence, 1e-3), np.float32),
        looks,
        mask=known,
        # The pieces' levels are the height reference's to tell, and its components are not used.
        bridge=False,
        conncomp_algorithm="linear",
    )
    return unwrapped


def _skimage(values: Complexes, coherence: Floats, looks: float, known: Flags) -> Floats:
    del coherence, looks  # It weighs paths by the phase itself.
    from skimage.restoration import unwrap_phase

    phase = phases.angle(values)
    masked = phase if known.all() else np.ma.masked_array(phase, ~known)
    return np.asarray(unwrap_phase(masked, rng=0))


def _kamui(values: Complexes, coherence: Floats, looks: float, known: Flags) -> Floats:
    del looks
    import kamui

    # Whole numbers let it take its network solver.
    weights = np.rint(1 + 99 * coherence).astype(int)
    edges, cells = kamui.get_2d_edges_and_simplices(values.shape)
    # A cut beside a pixel without a phase costs nothing.
    weights = np.where(known.ravel()[edges].all(axis=1), weights.ravel()[edges].sum(axis=1), 0)
    unwrapped = kamui.unwrap_arbitrary(
        phases.angle(values).ravel(), edges, cells, method="ilp", weights=weights
    )
    if unwrapped is None:
        raise ValueError("kamui found no unwrapping; try `unwrapping.method: whirlwind`")
    return np.asarray(unwrapped).reshape(values.shape)


def _snaphu(values: Complexes, coherence: Floats, looks: float, known: Flags) -> Floats:
    try:
        import snaphu
    except ImportError:
        raise ValueError(_NO_SNAPHU) from None
    unwrapped, _ = snaphu.unwrap(
        values.astype(np.complex64),
        coherence.astype(np.float32),
        nlooks=looks,
        cost="smooth",
        mask=None if known.all() else known,
    )
    return np.asarray(unwrapped)


def _baselines(values: Complexes, coherence: Floats, looks: float, known: Flags) -> Floats:
    del coherence, looks, known  # The shorter baselines tell all of it (`cycles`).
    return phases.angle(values)


UNWRAPPERS: dict[str, Callable[[Complexes, Floats, float, Flags], Floats]] = {
    "whirlwind": _whirlwind,
    "skimage": _skimage,
    "kamui": _kamui,
    "snaphu": _snaphu,
    "baselines": _baselines,
}


class Unwrapping(Section, name="unwrapping"):
    """Phase unwrapping."""

    method: Literal[*UNWRAPPERS] = key(  # type: ignore[valid-type]
        "the unwrapper; snaphu has to be installed by you; `baselines` takes each pixel's cycle "
        "from shorter ones alone (radar.baselines_m), which put the others' cycles right as well",
        "section 2.3, reference 15",
    )
    cycle_window_m: float = key(
        "side of the window over whose median shorter baselines settle the cycle",
        "not mentioned",
        gt=0,
    )


def unwrap(
    filtered: xr.Dataset, coherence: xr.DataArray, *, method: str, looks: float
) -> xr.Dataset:
    """Unwrap the filtered phase.

    A pixel that is zero or not finite has no phase. Such pixels may leave islands: each has its own
    level, which `height.phase_offset` takes from the reference on it.

    Parameters
    ----------
    filtered
        Product ``filtered``.
    coherence
        Coherence (y, x), which weights what may be cut.
    method
        The unwrapper. Whatever it is, each pixel comes out as its wrapped phase plus whole cycles.
    looks
        Effective number of independent looks of the coherence, at least 1.

    Returns
    -------
    xarray.Dataset
        Product ``unwrapped``; NaN where there is no phase, and nowhere else.

    Raises
    ------
    ValueError
        If the method is unknown or not installed.
    """
    if method not in UNWRAPPERS:
        raise ValueError(f"no unwrapper '{method}'; there are {', '.join(UNWRAPPERS)}")
    values = filtered["interferogram"].values
    known = np.isfinite(values) & (values != 0)
    wrapped = np.where(known, phases.angle(values), np.nan)
    if known.any():
        added = _solve(wrapped, known, values, coherence.values, method, looks) - wrapped
        # Solvers work in single precision and from any level: keep only their whole cycles.
        level = -np.angle(phases.rotation(added[known]).mean(dtype=complex))
        cycles = np.rint((added - level) / (2 * np.pi))
    else:
        cycles = wrapped
    return variables.dataset(
        "unwrapped",
        {"phase": wrapped + 2 * np.pi * cycles, "residue": residues(wrapped)},
        {"x": filtered["x"].values, "y": filtered["y"].values},
    )


def _solve(
    wrapped: Floats, known: Flags, values: Complexes, coherence: Floats, method: str, looks: float
) -> Floats:
    """Return the phase as the solver unwraps it, from any level (y, x), rad."""
    if min(wrapped.shape) == 1 and method != "baselines":
        return _along_a_line(wrapped, known)
    if not known.all():
        values = np.where(known, values, 1)
        coherence = np.where(known, np.nan_to_num(coherence), 0)
    return UNWRAPPERS[method](values, coherence, looks, known).astype(float)


def _along_a_line(wrapped: Floats, known: Flags) -> Floats:
    """Unwrap a single row or column, on which there is one path and no residue (Itoh 1982)."""
    result = wrapped.copy()
    numbers, count = masks.islands(known)
    for number in range(1, count + 1):
        part = numbers == number
        result[part] = np.unwrap(wrapped[part])
    return result


def _unwrapped(products: Products, study: Study) -> xr.Dataset:
    method = study.unwrapping.method
    result = unwrap(
        products["filtered"],
        products["interferogram"]["coherence"],
        method=method,
        looks=interferogram.looks(products["trajectory"], study),
    )
    if "short_baselines" in products:
        phase = cycles.settle(
            result["phase"].values,
            products["short_baselines"]["told_phase"].values,
            window_px=cycles.window(
                study.unwrapping.cycle_window_m, result["x"].values, result["y"].values
            ),
            unwrapped=method != "baselines",
        )
        result["phase"].values[:] = phase
    return result


STAGES = {
    "unwrapped": Stage(
        _unwrapped,
        inputs=("filtered", "interferogram", "trajectory"),
        sections=(*interferogram.LOOKS_KEYS, "unwrapping"),
        optional=("short_baselines",),
    ),
}


def _installed(unwrapping: Unwrapping) -> Iterator[Fault]:
    if unwrapping.method == "snaphu" and importlib.util.find_spec("snaphu") is None:
        yield Fault("unwrapping.method", "snaphu", _NO_SNAPHU)


CHECKS = (_installed,)
