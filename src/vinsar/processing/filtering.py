"""Filters of the interferometric phase."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations import blocks, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Complexes = NDArray[np.complexfloating]

# Patches in one batch of transforms: 4 MB, so that they stay in the cache.
_PIXELS_PER_BATCH = 500_000


variables.declare(
    "filtered",
    {
        "interferogram": Variable(GRID, "complex", "1", "filtered interferogram"),
    },
)


def goldstein(
    interferogram: Complexes, *, alpha: float, patch_px: int, step_px: int
) -> NDArray[np.complex64]:
    """Filter with the patch's own spectrum, raised to a power (Goldstein and Werner, 1998).

    Overlapping patches are transformed, multiplied with their magnitude spectrum, smoothed by
    3 x 3, to the power alpha, transformed back and added up with a tapered weight. Outside the
    interferogram there are zeros, which weigh nothing.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x).
    alpha
        Strength, 0 (none) to 1.
    patch_px
        Side of a patch, pixels.
    step_px
        Step between patches, pixels; it divides the side and is at most half of it.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram.

    Raises
    ------
    ValueError
        If alpha is outside 0..1, or the step does not divide the patch at least twice.
    """
    from scipy import fft

    from vinsar.kernels import patches as kernel

    if not 0 <= alpha <= 1:
        raise ValueError(f"Goldstein's alpha is {alpha}; take 0 to 1")
    if step_px < 1 or patch_px % step_px or patch_px < 2 * step_px:
        raise ValueError(
            f"a step of {step_px} pixels must divide the patch of {patch_px} pixels twice or more"
        )
    rows, columns = interferogram.shape
    # Every pixel lies in as many patches as every other.
    lead = patch_px - step_px
    down = -(-(rows + lead) // step_px)
    across = -(-(columns + lead) // step_px)
    padded = np.zeros(
        (lead + down * step_px + patch_px, lead + across * step_px + patch_px), np.complex64
    )
    padded[lead : lead + rows, lead : lead + columns] = interferogram
    windows = np.lib.stride_tricks.sliding_window_view(padded, (patch_px, patch_px))
    patches = windows[: down * step_px : step_px, : across * step_px : step_px]
    taper = np.sin(np.pi * (np.arange(patch_px) + 0.5) / patch_px).astype(np.float32) ** 2
    # Batches of rows of patches, each added up by itself: one result however many run at once.
    batch = max(1, _PIXELS_PER_BATCH // (across * patch_px**2))

    def work(begin: int) -> NDArray[np.complex64]:
        block = patches[begin : begin + batch]
        spectra = fft.fft2(block)
        weights = np.empty(spectra.shape, np.float32)
        kernel.smooth(spectra, weights)
        np.power(weights, np.float32(alpha), out=weights)
        spectra *= weights
        band = np.zeros(((len(block) - 1) * step_px + patch_px, padded.shape[1]), np.complex64)
        kernel.overlap_add(fft.ifft2(spectra, overwrite_x=True), taper, step_px, band)
        return band

    total = np.zeros_like(padded)
    begins = range(0, down, batch)
    for begin, band in zip(begins, blocks.run(work, ((n,) for n in begins)), strict=True):
        total[begin * step_px : begin * step_px + len(band)] += band
    # Tapers squared-sine at a step that divides the patch add up to a constant.
    gain = (patch_px / (2 * step_px)) ** 2
    return np.asarray(total[lead : lead + rows, lead : lead + columns] / gain, np.complex64)


def boxcar(interferogram: Complexes, *, window_px: int) -> NDArray[np.complex64]:
    """Average over a square window.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x).
    window_px
        Side of the window, pixels, odd.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram; at the edges, over what the window covers.

    Raises
    ------
    ValueError
        If the window is not odd and positive.
    """
    from scipy.ndimage import uniform_filter

    if window_px < 1 or window_px % 2 == 0:
        raise ValueError(f"the boxcar of {window_px} pixels must be odd and positive")
    values = np.asarray(interferogram, np.complex128)
    sums = uniform_filter(values, window_px, mode="constant")
    covered = [uniform_filter(np.ones(size), window_px, mode="constant") for size in values.shape]
    return np.asarray(sums / np.outer(*covered), np.complex64)


def gaussian(interferogram: Complexes, *, std_px: float) -> NDArray[np.complex64]:
    """Average with a Gaussian weight.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x).
    std_px
        Standard deviation of the weight, pixels; it averages as many pixels as a window of
        ``4 pi std_px^2`` of equal weights.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram; at the edges, over what there is.

    Raises
    ------
    ValueError
        If the standard deviation is not positive.
    """
    from scipy.ndimage import gaussian_filter1d

    if not std_px > 0:
        raise ValueError(f"a Gaussian of {std_px} pixels must be wider than 0")
    values = np.asarray(interferogram, np.complex64)
    for axis, size in enumerate(values.shape):
        covered = gaussian_filter1d(np.ones(size), std_px, mode="constant")
        parts = (
            gaussian_filter1d(part, std_px, axis=axis, mode="constant")
            for part in (values.real, values.imag)
        )
        shape = [1, 1]
        shape[axis] = size
        real, imag = (part / covered.reshape(shape) for part in parts)
        values = np.asarray(real + 1j * imag, np.complex64)
    return values


def _goldstein(
    values: Complexes,
    *,
    goldstein_alpha: float,
    goldstein_patch_px: int,
    goldstein_step_px: int,
    **_: Any,
) -> Complexes:
    return goldstein(
        values, alpha=goldstein_alpha, patch_px=goldstein_patch_px, step_px=goldstein_step_px
    )


def _boxcar(values: Complexes, *, boxcar_window_px: int, **_: Any) -> Complexes:
    return boxcar(values, window_px=boxcar_window_px)


def _none(values: Complexes, **_: Any) -> Complexes:
    return values


FILTERS: dict[str, Callable[..., Complexes]] = {
    "goldstein": _goldstein,
    "boxcar": _boxcar,
    "none": _none,
}
"""The filters by name; each takes the interferogram and, by keyword, the keys of `Filtering`."""


class Filtering(Section, name="filtering"):
    """The filter of the interferometric phase."""

    method: Literal[*FILTERS] = key(  # type: ignore[valid-type]
        "the filter", "section 2.2"
    )
    goldstein_alpha: float = key(
        "strength: exponent of the smoothed spectrum", "reference 19", ge=0, le=1
    )
    goldstein_patch_px: int = key("side of a patch", "reference 19", ge=4)
    goldstein_step_px: int = key("step between patches", "reference 19", ge=1)
    boxcar_window_px: int = key("side of the boxcar, odd", "not mentioned", ge=1)


def apply(interferogram: xr.Dataset, *, method: str, **options: Any) -> xr.Dataset:
    """Filter an interferogram with the chosen filter.

    Parameters
    ----------
    interferogram
        Product ``interferogram``.
    method
        A key of `FILTERS`; ``none`` passes the interferogram on.
    options
        The keys of `Filtering` that the filter reads.

    Returns
    -------
    xarray.Dataset
        Product ``filtered``.

    Raises
    ------
    ValueError
        If there is no such filter.
    """
    if method not in FILTERS:
        raise ValueError(f"no filter '{method}'; there are {', '.join(FILTERS)}")
    return variables.dataset(
        "filtered",
        {"interferogram": FILTERS[method](interferogram["interferogram"].values, **options)},
        {"x": interferogram["x"].values, "y": interferogram["y"].values},
    )


def _filtered(products: Products, study: Study) -> xr.Dataset:
    return apply(products["interferogram"], **study.filtering.model_dump())


def _goldstein_step(filtering: Filtering) -> Iterator[Fault]:
    patch, step = filtering.goldstein_patch_px, filtering.goldstein_step_px
    if patch % step or patch < 2 * step:
        steps = [n for n in range(1, patch // 2 + 1) if patch % n == 0]
        yield Fault(
            "filtering.goldstein_step_px",
            step,
            f"must divide filtering.goldstein_patch_px, {patch}, at least twice: "
            + ", ".join(map(str, steps)),
        )


def _odd_boxcar(filtering: Filtering) -> Iterator[Fault]:
    if filtering.boxcar_window_px % 2 == 0:
        yield Fault("filtering.boxcar_window_px", filtering.boxcar_window_px, "must be odd")


STAGES = {
    "filtered": Stage(_filtered, inputs=("interferogram",), sections=("filtering",), parallel=True),
}


CHECKS = (_goldstein_step, _odd_boxcar)
