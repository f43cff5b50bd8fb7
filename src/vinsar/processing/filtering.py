"""Filters of the interferometric phase."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.foundations import blocks, variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.processing import masks, response
from vinsar.processing.patches import Patches
from vinsar.radar import waveform

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

    Complexes = NDArray[np.complexfloating]
    Floats = NDArray[np.floating]
    Spectra = tuple[Floats, Floats, Floats]

# Patches in one batch of transforms: 4 MB, so that they stay in the cache.
_PIXELS_PER_BATCH = 500_000

# Bins of the spectrum that a filter's gain is summed over, and samples of a weighting.
_BINS, _BAND_SAMPLES = 512, 129


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
    interferogram, and where it is not finite, there are zeros, which weigh nothing.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x), NaN where there is none.
    alpha
        Strength, 0 (none) to 1.
    patch_px
        Side of a patch, pixels.
    step_px
        Step between patches, pixels; it divides the side and is at most half of it.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram; NaN where there was none.

    Raises
    ------
    ValueError
        If alpha is outside 0..1, or the step does not divide the patch at least twice.
    """
    from vinsar.kernels import patches as kernel

    if not 0 <= alpha <= 1:
        raise ValueError(f"Goldstein's alpha is {alpha}; take 0 to 1")
    if step_px < 1 or patch_px % step_px or patch_px < 2 * step_px:
        raise ValueError(
            f"a step of {step_px} pixels must divide the patch of {patch_px} pixels twice or more"
        )
    known = np.isfinite(interferogram)
    patches = Patches(known.shape, patch_px, step_px)
    padded = patches.padded(np.where(known, interferogram, 0))
    # Batches of columns of patches, each added up by itself: one result however many run at once.
    batch = max(1, _PIXELS_PER_BATCH // (patches.down * patch_px**2))

    def work(begin: int) -> NDArray[np.complex64]:
        spectra = patches.spectra(padded, begin, begin + batch)
        weights = np.empty(spectra.shape, np.float32)
        kernel.weigh(spectra, alpha, weights)
        spectra *= weights
        return patches.band(spectra)

    begins = range(0, patches.across, batch)
    bands = blocks.run(work, ((begin,) for begin in begins))
    filtered = np.asarray(patches.image(bands, [*begins]), np.complex64)
    filtered[~known] = np.nan
    return filtered


def boxcar(interferogram: Complexes, *, window_px: int) -> NDArray[np.complex64]:
    """Average over a square window.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x), NaN where there is none.
    window_px
        Side of the window, pixels, odd.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram, over the pixels that the window covers; NaN where there was none.

    Raises
    ------
    ValueError
        If the window is not odd and positive.
    """
    from scipy.ndimage import uniform_filter

    if window_px < 1 or window_px % 2 == 0:
        raise ValueError(f"the boxcar of {window_px} pixels must be odd and positive")

    def smooth(values: Complexes) -> Complexes:
        sums = uniform_filter(values, window_px, mode="constant")
        covered = [
            uniform_filter(np.ones(size), window_px, mode="constant") for size in values.shape
        ]
        return np.asarray(sums / np.outer(*covered))

    values = np.asarray(interferogram, np.complex128)
    return np.asarray(masks.average(smooth, values), np.complex64)


def gaussian(interferogram: Complexes, *, std_px: float) -> NDArray[np.complex64]:
    """Average with a Gaussian weight.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x), NaN where there is none.
    std_px
        Standard deviation of the weight, pixels; it averages as many pixels as a window of
        ``4 pi std_px^2`` of equal weights.

    Returns
    -------
    ndarray, shape (y, x), complex64
        Filtered interferogram, over the pixels that there are; NaN where there was none.

    Raises
    ------
    ValueError
        If the standard deviation is not positive.
    """
    from scipy.ndimage import gaussian_filter1d

    if not std_px > 0:
        raise ValueError(f"a Gaussian of {std_px} pixels must be wider than 0")

    def smooth(values: Complexes) -> Complexes:
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

    return masks.average(smooth, np.asarray(interferogram, np.complex64))


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


def _gaussian(values: Complexes, *, gaussian_std_px: float, **_: Any) -> Complexes:
    return gaussian(values, std_px=gaussian_std_px)


def _none(values: Complexes, **_: Any) -> Complexes:
    return values


def _goldstein_noise(
    gamma: Floats,
    spectra: Callable[[int], Spectra],
    *,
    goldstein_alpha: float,
    goldstein_patch_px: int,
    **_: Any,
) -> tuple[Floats, Floats]:
    """Return what a patch's expected gain leaves of white and of even noise.

    The expected magnitude spectrum is a peak of the coherence at the ground's fringe and
    Rayleigh-distributed speckle around it. Where relief spreads the fringe, more is left.
    """
    down, even, across = spectra(goldstein_patch_px)
    powers = np.outer(down, across), np.outer(even, across)
    magnitude = np.sqrt(np.pi / 4 * powers[0])
    magnitude[0, 0] = 0
    shifts = [(row, column) for row in (0, 1, -1) for column in (0, 1, -1)]
    smoothed = sum(np.roll(magnitude, shift, axis=(0, 1)) for shift in shifts)
    # Smoothing carries the peak to the bins next to it.
    near = tuple(np.transpose(shifts))
    peak = (gamma + smoothed[0, 0]) ** (2 * goldstein_alpha)
    beside = (gamma[..., None] + smoothed[near]) ** (2 * goldstein_alpha)
    gain = smoothed ** (2 * goldstein_alpha)
    gain[near] = 0
    white, even = ((beside @ power[near] + (gain * power).sum()) / peak for power in powers)
    return white, even


def _boxcar_noise(
    gamma: Floats, spectra: Callable[[int], Spectra], *, boxcar_window_px: int, **_: Any
) -> tuple[Floats, Floats]:
    return _average_noise(np.full(boxcar_window_px, 1 / boxcar_window_px), gamma, spectra)


def _gaussian_noise(
    gamma: Floats, spectra: Callable[[int], Spectra], *, gaussian_std_px: float, **_: Any
) -> tuple[Floats, Floats]:
    reach = np.arange(-int(4 * gaussian_std_px), int(4 * gaussian_std_px) + 1)
    weights = np.exp(-0.5 * (reach / gaussian_std_px) ** 2)
    return _average_noise(weights / weights.sum(), gamma, spectra)


def _average_noise(
    weights: Floats, gamma: Floats, spectra: Callable[[int], Spectra]
) -> tuple[Floats, Floats]:
    gain = np.abs(np.fft.fft(weights, _BINS)) ** 2
    down, even, across = (float(axis @ gain) for axis in spectra(_BINS))
    return np.full(gamma.shape, down * across), np.full(gamma.shape, even * across)


def _no_noise_less(
    gamma: Floats, spectra: Callable[[int], Spectra], **_: Any
) -> tuple[Floats, Floats]:
    del spectra
    return np.ones(gamma.shape), np.ones(gamma.shape)


def _goldstein_response(
    values: Complexes, *, goldstein_alpha: float, goldstein_patch_px: int, **_: Any
) -> response.Response:
    return response.Goldstein(values, alpha=goldstein_alpha, patch_px=goldstein_patch_px)


def _boxcar_response(values: Complexes, *, boxcar_window_px: int, **_: Any) -> response.Response:
    del values
    return response.Average(np.full(boxcar_window_px, 1 / boxcar_window_px))


def _gaussian_response(values: Complexes, *, gaussian_std_px: float, **_: Any) -> response.Response:
    del values
    return response.Average(response.gaussian_weights(gaussian_std_px))


def _no_response(values: Complexes, **_: Any) -> response.Response:
    del values
    return response.Average(np.ones(1))


@dataclass(frozen=True)
class Filter:
    """A filter, with what its results are worth.

    All three take, by keyword, the keys of `Filtering`.

    Attributes
    ----------
    apply
        From the complex interferogram to the filtered one.
    noise
        From coherence and spectra of the noise to what it leaves of a pixel's white and even noise
        (`effective_looks`).
    response
        From the interferogram that is filtered to the filter's response to phases
        (`vinsar.processing.response`).
    """

    apply: Callable[..., Complexes]
    noise: Callable[..., tuple[Floats, Floats]]
    response: Callable[..., response.Response]


FILTERS: dict[str, Filter] = {
    "goldstein": Filter(_goldstein, _goldstein_noise, _goldstein_response),
    "boxcar": Filter(_boxcar, _boxcar_noise, _boxcar_response),
    "gaussian": Filter(_gaussian, _gaussian_noise, _gaussian_response),
    "none": Filter(_none, _no_noise_less, _no_response),
}
"""The filters by name."""


def find(method: str) -> Filter:
    """Return a filter by its name; `ValueError` if there is none."""
    if method not in FILTERS:
        raise ValueError(f"no filter '{method}'; there are {', '.join(FILTERS)}")
    return FILTERS[method]


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
    gaussian_std_px: float = key(
        "standard deviation of the Gaussian; it averages 4 pi times its square",
        "not mentioned",
        gt=0,
    )


def smooth(interferogram: Complexes, *, method: str, **options: Any) -> Complexes:
    """Filter an interferogram with the chosen filter.

    Parameters
    ----------
    interferogram
        Complex interferogram (y, x), NaN where there is none.
    method
        A key of `FILTERS`; ``none`` passes the interferogram on.
    options
        The keys of `Filtering` that the filter reads.

    Returns
    -------
    ndarray, shape (y, x)
        Filtered interferogram; NaN there and nowhere else.

    Raises
    ------
    ValueError
        If there is no such filter.
    """
    return find(method).apply(interferogram, **options)


def response_to(interferogram: Complexes, *, method: str, **options: Any) -> response.Response:
    """Return the response to phases of the filter that is applied to an interferogram.

    Parameters
    ----------
    interferogram
        What is filtered (y, x).
    method
        A key of `FILTERS`.
    options
        The keys of `Filtering` that the filter reads.

    Raises
    ------
    ValueError
        If there is no such filter.
    """
    return find(method).response(interferogram, **options)


def apply(interferogram: xr.Dataset, **options: Any) -> xr.Dataset:
    """Filter an interferogram with the chosen filter.

    Parameters
    ----------
    interferogram
        Product ``interferogram``.
    options
        As in `smooth`.

    Returns
    -------
    xarray.Dataset
        Product ``filtered``.
    """
    return variables.dataset(
        "filtered",
        {"interferogram": smooth(interferogram["interferogram"].values, **options)},
        {"x": interferogram["x"].values, "y": interferogram["y"].values},
    )


def effective_looks(
    coherence: ArrayLike,
    cell_px: tuple[float, float],
    *,
    method: str,
    windows: tuple[waveform.WindowName, waveform.WindowName] = ("rectangular", "rectangular"),
    shifted: ArrayLike = 0.0,
    **options: Any,
) -> Floats:
    """Return over how many independent looks a filter averages level ground.

    By its equivalent noise bandwidth: of the phase noise of a pixel the filter's gain leaves a
    share of one over the looks. Noise of an image's whole band W has, multiplied with the other
    image, the spectrum ``W^2 * W^2``. The baseline decorrelates the ends of the bands, each far
    from the middle of the other image's band: that noise is even over the spectrum along y, and
    half as strong in its middle.

    Parameters
    ----------
    coherence
        Coherence, 0 to 1.
    cell_px
        Resolution in y and x, pixels.
    method
        A key of `FILTERS`.
    windows
        Weightings along y and x, of the band and of the aperture.
    shifted
        Share of the noise that the baseline's decorrelation makes, 0 to 1 (`shifted_share`).
    options
        The keys of `Filtering` that the filter reads.

    Returns
    -------
    ndarray
        Looks, 1 or more, in the shape of `coherence`.

    Raises
    ------
    ValueError
        If there is no such filter.
    """
    gamma, share = np.broadcast_arrays(np.asarray(coherence, float), np.asarray(shifted, float))

    def spectra(count: int) -> Spectra:
        return _spectra(count, cell_px, windows)

    white, even = find(method).noise(gamma, spectra, **options)
    return np.asarray(1 / (white + share * (even - white)))


def shifted_share(coherence: ArrayLike, geometric: ArrayLike) -> Floats:
    """Return the share of the phase noise that the baseline's decorrelation makes.

    Parameters
    ----------
    coherence
        Coherence, 0 to 1.
    geometric
        Coherence that the baseline alone leaves.

    Returns
    -------
    ndarray
        ``(1 / gamma_geo^2 - 1) / (1 / gamma^2 - 1)``, at most 1.
    """
    gamma, geometric = np.asarray(coherence, float), np.asarray(geometric, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (1 / geometric**2 - 1) / (1 / gamma**2 - 1)
    return np.where(np.isfinite(share), np.minimum(share, 1), 0.0)


@lru_cache(maxsize=256)
def _spectra(
    count: int,
    cell_px: tuple[float, float],
    windows: tuple[waveform.WindowName, waveform.WindowName],
) -> Spectra:
    """Return spectra of noise by bin, each of sum 1: white and even along y, white along x."""
    found = []
    for cell, window in zip(cell_px, windows, strict=True):
        power = waveform.window(window, _BAND_SAMPLES) ** 2
        shape = np.correlate(power, power, "full")[_BAND_SAMPLES - 1 :]
        offset = np.abs(np.fft.fftfreq(count)) * cell
        white = np.interp(offset, np.linspace(0, 1, _BAND_SAMPLES), shape, right=0.0)
        found += [white, (offset <= 1).astype(float)]
    down, even, across = (values / values.sum() for values in found[:3])
    return down, even, across


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
