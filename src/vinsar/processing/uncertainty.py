"""What a height is worth: the variance of its phase, from the data alone.

Three things err in a filtered phase.

* **Noise.** Given the magnitude |Z| of an interferogram, the phase of a circular Gaussian pair is
  distributed as ``exp(|Z| cos(phi) / nu)`` (Lee et al. 1994), with ``nu = P (1 - gamma^2) /
  2 gamma``: dark pixels are noisy, however coherent their surroundings. The power nu of the noise
  is that of the images' difference, ``E |s1 - s2 u|^2 / 2 = P (1 - gamma)`` with the phase u
  removed, which does not depend on the speckle's own brightness, as a sample coherence does. A
  filter leaves a part of it (`vinsar.processing.response`).
* **Smoothing.** Resolution cell and filter average over terrain. What they take away from the
  phase that is left tells what they have taken away from the true one: ``(1 - F) phi`` from
  ``(1 - F) F phi``, to second order ``2 (1 - F) F phi - (1 - F) F^2 phi``. It is an error of fixed
  sign in each place; over the surroundings its mean square counts as variance.
* **The height reference**, whose error all heights share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.radar.decorrelation import Decorrelation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from vinsar.processing.response import Response

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

PHASE_LOOKS = 9.0
"""Looks of the window whose mean phase is the surroundings'."""

NOISE_LOOKS = 42.0
"""Looks of the window over which the noise's power is averaged: to a sixth, by its chi-square."""

UNIFORM = np.pi**2 / 3
"""Variance of a phase of which nothing is known, rad^2."""

# Sidelobes of the point response count so far, in resolution cells.
_REACH_CELLS = 3

_TINY = float(np.finfo(float).tiny)


def window(looks: float, resolution: Floats, spacing_m: float) -> int:
    """Return the side of a square window of about so many looks, an odd number of pixels.

    Parameters
    ----------
    looks
        Independent looks: resolution cells in the window.
    resolution
        Resolution in x and y (2, y, x), m.
    spacing_m
        Spacing of the pixels, m.
    """
    side = np.sqrt(looks * np.median(resolution[0] * resolution[1])) / spacing_m
    return 2 * max(0, round(float(side - 1) / 2)) + 1


def mean(values: NDArray[Any], window_px: int | tuple[int, int]) -> NDArray[Any]:
    """Return the mean over a window around each pixel, real or complex (y, x)."""
    from scipy.ndimage import uniform_filter

    if np.iscomplexobj(values):
        parts = (
            uniform_filter(part.astype(float), window_px) for part in (values.real, values.imag)
        )
        real, imag = parts
        return np.asarray(real + 1j * imag)
    return np.asarray(uniform_filter(np.asarray(values, float), window_px))


def unit(values: Complexes) -> Complexes:
    """Return complex values of the same phase and of magnitude 1; 0 where there is nothing."""
    return np.asarray(values / np.maximum(np.abs(values), _TINY))


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
    resolution: Floats,
    spacing_m: float,
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
    resolution
        Resolution in x and y (2, y, x), m.
    spacing_m
        Spacing of the pixels, m.
    relative_bandwidth
        Bandwidth over the carrier.

    Returns
    -------
    Noise
        Power and origin.
    """
    wide = window(NOISE_LOOKS, resolution, spacing_m)
    narrow = window(PHASE_LOOKS, resolution, spacing_m)
    powers = [mean(np.abs(image) ** 2, wide) for image in images]
    # The channels may differ in gain: both are scaled to their common power.
    ratio = np.sqrt(np.maximum(powers[0], _TINY) / np.maximum(powers[1], _TINY))
    power = np.sqrt(np.maximum(powers[0] * powers[1], _TINY))
    product = images[0] * np.conj(images[1])
    along = (product * np.conj(unit(mean(product, narrow)))).real
    both = (np.abs(images[0]) ** 2 / ratio + np.abs(images[1]) ** 2 * ratio) / 2
    difference = np.maximum(mean(both - along, wide), 0) / power
    looks = np.maximum(1.0, (narrow * spacing_m) ** 2 / (resolution[0] * resolution[1]))
    coherence = unbiased(1 - difference, looks)
    absolute = mean(phase, narrow)
    shift = np.stack(np.gradient(absolute, spacing_m)[::-1]) * resolution / (2 * np.pi)
    above = mean(phase - flat, narrow)
    fringes = np.stack(np.gradient(above, spacing_m)[::-1]) / (2 * np.pi)
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
    noise: Noise, response: Response, product: Complexes, filtered: Complexes, *, spacing_m: float
) -> Floats:
    """Return the variance that noise leaves in the filtered phase.

    Parameters
    ----------
    noise
        The noise before the filter.
    response
        The filter.
    product, filtered
        Interferogram before and after the filter (y, x).
    spacing_m
        Spacing of the pixels, m.

    Returns
    -------
    ndarray, shape (y, x)
        Variance, rad^2; that of a uniform phase where there is no signal.
    """
    resolution = noise.decorrelation.resolution
    if response.follows_amplitude:
        amplitude = np.abs(filtered)
    else:
        amplitude = np.abs(mean(product, window(PHASE_LOOKS, resolution, spacing_m)))
    gain = response.gain(noise.decorrelation, product.shape, spacing_m)
    inverse = gain * noise.power / np.maximum(amplitude, _TINY)
    # The interval of a von Mises distribution that holds 68.3 %, to 5 % from |Z| = nu up.
    return np.minimum(inverse * (1 + np.minimum(inverse, 10) / 2), UNIFORM)


def smoothing(
    response: Response, product: Complexes, *, resolution: Floats, spacing_m: float
) -> Floats:
    """Return what resolution cell and filter have taken away from the phase.

    Parameters
    ----------
    response
        The filter.
    product
        Interferogram before the filter (y, x). Its mean over a few looks stands for the terrain.
    resolution
        Resolution in x and y (2, y, x), m.
    spacing_m
        Spacing of the pixels, m.

    Returns
    -------
    ndarray, shape (y, x)
        Filtered less true phase, rad.
    """
    side = window(PHASE_LOOKS, resolution, spacing_m)
    signal = mean(product, side)
    amplitude = np.abs(signal)
    spread = [_point_power(float(np.median(part)), spacing_m) for part in resolution]

    def again(phase: Complexes) -> Complexes:
        return response.apply(_blur(amplitude * phase, *spread).astype(np.complex64))

    start = unit(signal)
    first = again(start)
    second = again(unit(first))
    once = np.angle(first * np.conj(start))
    twice = np.angle(second * np.conj(unit(first)))
    return np.asarray(mean(2 * once - twice, side), float)


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
    noise: Noise,
    product: Complexes,
    rectangles: Sequence[tuple[slice, slice]],
    level: Floats,
    *,
    spacing_m: float,
) -> float:
    """Return the variance of a constant phase that rectangles of level ground tell.

    Noise is averaged over each rectangle. What departs from level within one by more than its
    noise may be common to all of it: ground is rough, and not level.

    Parameters
    ----------
    noise
        The noise before any filter.
    product
        Interferogram (y, x).
    rectangles
        Rows and columns of each.
    level
        Phase that the interferogram would have there if the ground were level (y, x), rad.
    spacing_m
        Spacing of the pixels, m.

    Returns
    -------
    float
        Variance, rad^2.
    """
    from vinsar.processing.response import rectangle_gain

    side = window(PHASE_LOOKS, noise.decorrelation.resolution, spacing_m)
    smooth = mean(product * np.exp(-1j * level), side)
    total = 0.0
    for rows, columns in rectangles:
        part = smooth[rows, columns]
        middle = (rows.start + rows.stop) // 2, (columns.start + columns.stop) // 2
        here = noise.decorrelation.at(tuple(np.array([place]) for place in middle))
        ratio = float(noise.power[rows, columns].mean() / max(np.abs(part.mean()), _TINY))
        left = ratio * rectangle_gain(here, part.shape, spacing_m)
        seen = ratio * rectangle_gain(here, (side, side), spacing_m)
        residual = np.angle(part * np.conj(unit(part.mean())))
        total += left + max(0.0, float(residual.var()) - seen)
    return total / len(rectangles) ** 2
