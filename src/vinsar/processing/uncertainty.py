"""What a height is worth: the variance of its phase, from the data alone.

Three things err in a filtered phase.

* **Noise.** Given the magnitude |Z| of an interferogram, the phase of a circular Gaussian pair is
  distributed as ``exp(|Z| cos(phi) / nu)`` (Lee et al. 1994), with ``nu = P (1 - gamma^2) /
  2 gamma``: dark pixels are noisy, however coherent their surroundings. The power nu of the noise
  is that of the images' difference, ``E |s1 - s2 u|^2 / 2 = P (1 - gamma)`` with the phase u
  removed, which does not depend on the speckle's own brightness, as a sample coherence does. A
  filter leaves a part of it (`vinsar.processing.response`).
* **Smoothing.** Resolution cell and filter average over terrain. What they take away from the
  phase of a few looks tells what they have taken away from the true one. It is an error of fixed
  sign in each place; over the surroundings its mean square counts as variance.
* **Roughness** that a few looks hide as the filter does. Speckle and noise of pixels further apart
  than a resolution cell are independent, so what such phases have in common is the ground's.
* **The height reference**, whose error all heights share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vinsar.processing import phases, response
from vinsar.radar.decorrelation import Decorrelation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Flags = NDArray[np.bool_]
    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]
    Spacing = tuple[float, float]

PHASE_LOOKS = 9.0
"""Looks of the window whose mean phase is the surroundings'."""

NOISE_LOOKS = 42.0
"""Looks of the window over which the noise's power is averaged: to a sixth, by its chi-square."""

# Rough ground: looks of the window whose mean phase it departs from, correlation lengths tried and
# the longest distance at which its pixels are compared, in resolution cells in x, and looks of the
# window over which they are.
_TREND_LOOKS, _ROUGH_CELLS, _REACH_LAGS, _ROUGH_LOOKS = 25.0, (1.2, 1.6, 2.2, 3.3), 2.8, 500.0

# What departs by so many standard deviations does not count, nor does a window so dark.
_STANDS_OUT, _LEAST_WEIGHT = 3.0, 0.1

# Median of the magnitude of a normal distribution, over its standard deviation.
_MEDIAN_OF_NORMAL = 0.6745

UNIFORM = np.pi**2 / 3
"""Variance of a phase of which nothing is known, rad^2."""

# Sidelobes of the point response count so far, in resolution cells.
_REACH_CELLS = 3

_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Cells:
    """Resolution cells of an image.

    Attributes
    ----------
    resolution
        Resolution in x and y (2, y, x), m.
    spacing
        Spacing of the pixels in x and y, m.
    """

    resolution: Floats
    spacing: Spacing

    @cached_property
    def typical(self) -> tuple[float, float]:
        """Median resolution in x and in y, m."""
        # It changes slowly: a few of its values tell their median.
        across, ahead = (float(np.median(part[::4, ::4])) for part in self.resolution)
        return across, ahead

    @property
    def area(self) -> float:
        """Area of a cell of median sides, m^2."""
        return self.typical[0] * self.typical[1]

    def window(self, looks: float, *, elongation: float = 1) -> tuple[int, int]:
        """Return the sides of a square window of about so many looks, odd numbers of pixels.

        Parameters
        ----------
        looks
            Independent looks: resolution cells in the window.
        elongation
            How many times longer in y than in x, for a window that is no square.

        Returns
        -------
        tuple of int
            Rows and columns.
        """
        side, stretch = float(np.sqrt(looks * self.area)), float(np.sqrt(elongation))
        return _odd(side * stretch / self.spacing[1]), _odd(side / stretch / self.spacing[0])

    def extent(self, window_px: tuple[int, int]) -> float:
        """Return the area of a window, m^2."""
        return window_px[0] * self.spacing[1] * window_px[1] * self.spacing[0]


def _odd(count: float) -> int:
    return 2 * max(0, round((count - 1) / 2)) + 1


def mean(
    values: NDArray[Any],
    window_px: tuple[int, int],
    *,
    outside: Literal["mirror", "zero"] = "mirror",
) -> NDArray[Any]:
    """Return the mean over a window around each pixel.

    Parameters
    ----------
    values
        Real or complex values (y, x), or several of each pixel (y, x, n).
    window_px
        Rows and columns of the window, odd.
    outside
        What counts as lying outside the image: its mirror image, or zeros.

    Returns
    -------
    ndarray
        Means in double precision, of the shape of the values.
    """
    from vinsar.kernels import windows

    kind = complex if np.iscomplexobj(values) else float
    parts = np.ascontiguousarray(values, kind).view(float).reshape(len(values), -1)
    found = np.empty(values.shape, kind)
    rows, columns = (
        _places(size, side, outside) for size, side in zip(values.shape[:2], window_px, strict=True)
    )
    windows.mean(parts, rows, columns, window_px, found.view(float).reshape(parts.shape))
    return found


@lru_cache(maxsize=256)
def _places(size: int, side: int, outside: Literal["mirror", "zero"]) -> NDArray[np.integer]:
    """Return which of so many pixels windows of some side hold, one after the other; -1 for 0."""
    if outside == "mirror":
        return np.pad(np.arange(size), side // 2, mode="symmetric")
    return np.pad(np.arange(size), side // 2, constant_values=-1)


def slopes(values: Floats, spacing: Spacing) -> Floats:
    """Return the derivatives of values (y, x) by x and by y (2, y, x); 0 along a single pixel."""
    found = np.zeros((2, *values.shape))
    for lines, along, step in zip((found[0].T, found[1]), (values.T, values), spacing, strict=True):
        if len(along) > 1:
            lines[1:-1] = (along[2:] - along[:-2]) / (2 * step)
            lines[0], lines[-1] = (along[1] - along[0]) / step, (along[-1] - along[-2]) / step
    return found


@dataclass(frozen=True)
class Noise:
    """The noise of an interferogram before any filter.

    Attributes
    ----------
    power
        Power nu of the noise (y, x), in the images' units squared.
    decorrelation
        What it comes from, at each pixel.
    """

    power: Floats
    decorrelation: Decorrelation


def estimate(
    images: Complexes,
    phase: Floats,
    flat: Floats,
    *,
    cells: Cells,
    relative_bandwidth: float,
) -> Noise:
    """Return the noise of two images' interferogram.

    Parameters
    ----------
    images
        The two images (2, y, x).
    phase
        Absolute phase (y, x), rad: its slope is the shift of the images' bands, and what of it is
        not the ground plane's their displacement.
    flat
        Phase of the ground plane (y, x), rad.
    cells
        Resolution cells and pixels.
    relative_bandwidth
        Bandwidth over the carrier.

    Returns
    -------
    Noise
        Power and origin.
    """
    resolution, spacing = cells.resolution, cells.spacing
    wide, narrow = cells.window(NOISE_LOOKS), cells.window(PHASE_LOOKS)
    powers = [mean(np.abs(image) ** 2, wide) for image in images]
    # The channels may differ in gain: both are scaled to their common power.
    ratio = np.sqrt(np.maximum(powers[0], _TINY) / np.maximum(powers[1], _TINY))
    power = np.sqrt(np.maximum(powers[0] * powers[1], _TINY))
    product = images[0] * np.conj(images[1])
    along = (product * np.conj(phases.unit(mean(product, narrow)))).real
    both = (np.abs(images[0]) ** 2 / ratio + np.abs(images[1]) ** 2 * ratio) / 2
    difference = np.maximum(mean(both - along, wide), 0) / power
    looks = np.maximum(1.0, cells.extent(narrow) / (resolution[0] * resolution[1]))
    coherence = unbiased(1 - difference, looks)
    absolute = mean(phase, narrow)
    shift = slopes(absolute, spacing) * resolution / (2 * np.pi)
    above = mean(phase - flat, narrow)
    fringes = slopes(above, spacing) / (2 * np.pi)
    return Noise(
        power=np.asarray(power * (1 - coherence**2) / (2 * coherence)),
        decorrelation=Decorrelation(
            coherence=coherence,
            shift=np.minimum(np.abs(shift), 1),
            displacement=np.abs(above) / (2 * np.pi) * relative_bandwidth,
            resolution=resolution,
            fringes=np.abs(fringes),
        ),
    )


def unbiased(coherence: Floats, looks: Floats) -> Floats:
    """Return a coherence without the bias of the looks that its phase was taken from.

    The mean magnitude of L looks has ``E^2 = gamma^2 + k (1 - gamma^2) / 2L``: its noise across the
    phase adds to it, k = 1 where the coherence is high and pi / 2 where there is none.

    Parameters
    ----------
    coherence
        Mean of the looks along their own mean phase, over their power.
    looks
        Number of looks.

    Returns
    -------
    ndarray
        Coherence, from 0.02 to 0.9999: beyond, it says no more than that there is none, or no
        noise.
    """
    squared = np.clip(coherence, 0, 1) ** 2
    share = (1 + (np.pi / 2 - 1) * (1 - squared) ** 2) / (2 * looks)
    left = (squared - share) / np.maximum(1 - share, _TINY)
    return np.asarray(np.clip(np.sqrt(np.maximum(left, 0)), 0.02, 0.9999))


def noise_variance(
    noise: Noise,
    filter_: response.Response,
    product: Complexes,
    filtered: Complexes,
    *,
    cells: Cells,
) -> Floats:
    """Return the variance that noise leaves in the filtered phase.

    Parameters
    ----------
    noise
        The noise before the filter.
    filter_
        The filter.
    product, filtered
        Interferogram before and after the filter (y, x).
    cells
        Resolution cells and pixels.

    Returns
    -------
    ndarray, shape (y, x)
        Variance, rad^2; that of a uniform phase where there is no signal.
    """
    if filter_.follows_amplitude:
        amplitude = np.abs(filtered).astype(float)
    else:
        amplitude = np.abs(mean(product, cells.window(PHASE_LOOKS)))
    gain = filter_.gain(noise.decorrelation, product.shape, cells.spacing)
    left = gain * noise.power
    # Beyond 10 it is uniform, and where there is no signal.
    inverse = np.divide(left, amplitude, out=np.full(left.shape, 10.0), where=amplitude > 0)
    inverse = np.minimum(inverse, 10)
    # The interval of a von Mises distribution that holds 68.3 %, to 5 % from |Z| = nu up.
    return np.minimum(inverse * (1 + inverse / 2), UNIFORM)


def smoothing(filter_: response.Response, product: Complexes, *, cells: Cells) -> Floats:
    """Return what resolution cell and filter have taken away from the phase.

    Parameters
    ----------
    filter_
        The filter.
    product
        Interferogram before the filter (y, x). Its mean over a few looks stands for the terrain.
    cells
        Resolution cells and pixels.

    Returns
    -------
    ndarray, shape (y, x)
        Filtered less true phase, rad.
    """
    side = cells.window(PHASE_LOOKS)
    signal = mean(product, side)
    amplitude = np.abs(signal)
    spread = [
        _point_power(side, step) for side, step in zip(cells.typical, cells.spacing, strict=True)
    ]

    start = phases.unit(signal)
    again = filter_.apply(_blur(amplitude * start, *spread).astype(np.complex64))
    return np.asarray(mean(phases.angle(again * np.conj(start)), side), float)


def roughness(filter_: response.Response, product: Complexes, *, cells: Cells) -> Floats:
    """Return the variance of what resolution cell and filter take away from rough ground.

    Pixels a resolution cell and more apart in x share no noise, whatever the baseline makes of it
    along y. To the products of their phases about their mean over some looks a Gaussian
    autocorrelation is fitted by least squares: its length, out of `_ROUGH_CELLS`, over the whole
    image, its variance around each pixel. Shorter waves no two cells share. Of the variance cell
    and filter take their part.

    Parameters
    ----------
    filter_
        The filter.
    product
        Interferogram before the filter (y, x).
    cells
        Resolution cells and pixels.

    Returns
    -------
    ndarray, shape (y, x)
        Variance, rad^2; 0 where there is no roughness to be seen.
    """
    spacing, trend = cells.spacing, cells.window(_TREND_LOOKS)
    cell = cells.typical
    seen = product != 0
    if trend == (1, 1) or not seen.any():
        return np.zeros(product.shape)
    around = product * np.conj(phases.unit(mean(product, trend)))
    few = phases.angle(mean(around, cells.window(PHASE_LOOKS)))
    # Walls and steep slopes are no roughness.
    usual = np.abs(few) < _STANDS_OUT * float(np.median(np.abs(few[seen]))) / _MEDIAN_OF_NORMAL
    left = np.where(usual, product, 0)
    around = left * np.conj(phases.unit(mean(left, trend)))
    across, amplitude = around.imag, np.abs(around)
    reach = [max(1, round(_REACH_LAGS * cell[0] / step)) for step in spacing]
    lags = _Lags(product.shape, 2 * max(reach))
    used = (lags.rows <= reach[1]) & (lags.columns <= reach[0])
    used &= lags.columns * spacing[0] >= cell[0]
    spectra = lags.spectrum(across), lags.spectrum(amplitude)
    products, pairs = (lags.autocorrelation(part)[used] for part in spectra)
    fits = []
    for length in _ROUGH_CELLS:
        ground = response.Rough(length * cell[0], cell, spacing, trend)
        expected = ground.correlation(lags.count)[used]
        size = max(float(pairs @ expected**2), _TINY)
        fits.append((max(float(products @ expected), 0) ** 2 / size, ground, expected))
    _, ground, expected = max(fits, key=lambda fit: fit[0])
    wide = cells.window(_ROUGH_LOOKS)
    found, weight = (
        mean(part * lags.correlate(spectrum, used, values), wide)
        for part, spectrum, values in (
            (across, spectra[0], expected),
            (amplitude, spectra[1], expected**2),
        )
    )
    weight = np.maximum(weight, max(_LEAST_WEIGHT * float(np.median(weight)), _TINY))
    # What noise makes of it: the products' correlation over cells of sinc^2 is (2/3)^2 of them.
    own = mean(across**2, wide) / np.maximum(mean(amplitude, wide), _TINY)
    pixels = max(1.0, 4 / 9 * cell[0] * cell[1] / (spacing[0] * spacing[1]))
    error = own * pixels * np.sqrt(2 / (wide[0] * wide[1] * weight))
    told = np.maximum(found / weight, _TINY)
    # Shrunk by it, so that level ground has hardly any.
    variance = np.maximum(told - error**2 / told, 0)
    return np.asarray(np.minimum(variance, UNIFORM) * filter_.taken(ground, product.shape))


class _Lags:
    """Distances between the pixels of an image, by FFT.

    Parameters
    ----------
    shape
        Shape of the image.
    most
        Largest distance along either axis, pixels.
    """

    def __init__(self, shape: tuple[int, int], most: int) -> None:
        from scipy import fft

        self.shape = shape
        self.count = 2 * most + 1
        self.padded = tuple(fft.next_fast_len(size + most, real=True) for size in shape)
        lag = np.rint(np.fft.fftfreq(self.count, 1 / self.count)).astype(int)
        self.places = np.ix_(lag, lag)
        self.rows, self.columns = np.abs(self.places[0]), np.abs(self.places[1])

    def spectrum(self, values: Floats) -> Complexes:
        """Return the spectrum of an image (y, x)."""
        from scipy import fft

        return np.asarray(fft.rfft2(values, self.padded))

    def autocorrelation(self, spectrum: Complexes) -> Floats:
        """Return the sums of an image's products by distance (count, count), as of an FFT."""
        from scipy import fft

        power = spectrum.real**2 + spectrum.imag**2
        return np.asarray(fft.irfft2(power, self.padded)[self.places])

    def correlate(self, spectrum: Complexes, used: Flags, values: Floats) -> Floats:
        """Return an image weighted with even values of some of the distances (y, x)."""
        from scipy import fft

        kernel = np.zeros((self.count, self.count))
        kernel[used] = values
        padded = np.zeros(self.padded)
        padded[self.places] = kernel
        sums = fft.irfft2(spectrum * fft.rfft2(padded).real, self.padded)
        return np.asarray(sums[: self.shape[0], : self.shape[1]])


def _point_power(resolution_m: float, spacing_m: float) -> Floats:
    """Return the point response's power along one axis, by pixels, of sum 1."""
    reach = max(1, round(_REACH_CELLS * resolution_m / spacing_m))
    power = np.sinc(np.arange(-reach, reach + 1) * spacing_m / resolution_m) ** 2
    return np.asarray(power / power.sum())


def _blur(values: Complexes, along_x: Floats, along_y: Floats) -> Complexes:
    from scipy.ndimage import convolve1d

    def both(part: Floats) -> Floats:
        across = convolve1d(part, along_x, axis=1, mode="nearest")
        return np.asarray(convolve1d(across, along_y, axis=0, mode="nearest"))

    return np.asarray(both(values.real) + 1j * both(values.imag))


def reference_variance(
    noise: Noise, product: Complexes, level: Floats, where: tuple[slice, slice], *, cells: Cells
) -> float:
    """Return the variance of the phase that a rectangle of level ground tells.

    Noise is averaged over the rectangle. What departs from level within it by more than its noise
    may be common to all of it: ground is rough, and not level.

    Parameters
    ----------
    noise
        The noise before any filter.
    product
        Interferogram (y, x).
    level
        Phase that the interferogram has there if the ground is level (y, x), rad.
    where
        Rows and columns of the rectangle.
    cells
        Resolution cells and pixels.

    Returns
    -------
    float
        Variance, rad^2; at most that of a uniform phase.
    """
    spacing, side = cells.spacing, cells.window(PHASE_LOOKS)
    # As far around the rectangle as the window reaches.
    around = tuple(
        slice(max(0, axis.start - reach // 2), axis.stop + reach // 2)
        for axis, reach in zip(where, side, strict=True)
    )
    inside = tuple(
        slice(axis.start - wider.start, axis.stop - wider.start)
        for axis, wider in zip(where, around, strict=True)
    )
    part = mean(product[around] * np.exp(-1j * level[around]), side)[inside]
    middle = tuple(np.array([(axis.start + axis.stop) // 2]) for axis in where)
    here = noise.decorrelation.at(middle)
    ratio = float(noise.power[where].mean() / max(np.abs(part.mean()), _TINY))
    left = ratio * response.rectangle_gain(here, part.shape, spacing)
    seen = ratio * response.rectangle_gain(here, side, spacing)
    residual = phases.angle(part * np.conj(phases.unit(part.mean())))
    return float(min(left + max(0.0, float(residual.var()) - seen), UNIFORM))
