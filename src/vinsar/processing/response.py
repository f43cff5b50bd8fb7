"""What a filter of the interferogram does to signal and to noise.

Each filter is linear, or nearly so once its weights are known (Goldstein's follow from the data).
What it leaves of the noise follows from its weights and the noise's correlation
(`vinsar.radar.decorrelation`), and what it takes from the signal from applying it again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from vinsar.processing.patches import Patches

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from vinsar.radar.decorrelation import Decorrelation

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

# Noise changes over windows of metres: its gain is computed at nodes so many pixels apart.
_NODE_PX = 6

# A Gaussian's weights are cut where they are below 1 %.
_REACH = 3


class Response(Protocol):
    """A filter with its weights."""

    @property
    def follows_amplitude(self) -> bool:
        """Whether what comes out is as large as the looks that went in, and as sure."""
        ...

    def apply(self, values: Complexes) -> Complexes:
        """Return values (y, x) filtered with these weights."""
        ...

    def gain(
        self, noise: Decorrelation, shape: tuple[int, int], spacing: tuple[float, float]
    ) -> Floats:
        """Return the noise that is left over the noise that went in.

        Parameters
        ----------
        noise
            What decorrelates each pixel (y, x).
        shape
            Shape of the image.
        spacing
            Spacing of its pixels in x and y, m.

        Returns
        -------
        ndarray, shape (y, x)
            Variance across the mean phase, 1 for no filter; one over the effective looks.
        """
        ...

    def neighbours(self, noise: Decorrelation, spacing: tuple[float, float]) -> Floats:
        """Return the correlation of a pixel's noise with that of the next one along y (y, x)."""
        ...


@dataclass(frozen=True)
class Average:
    """A weighted average, the same along x and along y.

    Attributes
    ----------
    weights
        Weights along one axis (2 n + 1,), of sum 1.
    """

    weights: Floats
    follows_amplitude: bool = True

    def apply(self, values: Complexes) -> Complexes:
        """Return values (y, x) averaged; at the edges, over what there is."""
        if self.weights.size == 1:
            return values
        total = _separable(values, self.weights)
        covered = _separable(np.ones(values.shape), self.weights)
        return np.asarray(total / covered)

    def gain(
        self, noise: Decorrelation, shape: tuple[int, int], spacing: tuple[float, float]
    ) -> Floats:
        """Return the noise that is left over the noise that went in, as in `Response`.

        Across the fringes the average sees ``w(d) exp(-2 pi i f d)``: with X the filtered noise,
        the variance across the phase is ``(E|X|^2 - Re E X^2) / 2``.
        """
        if self.weights.size == 1:
            return np.ones(shape)
        rows, columns = (_nodes(size) for size in shape)
        part = noise.at(np.ix_(rows, columns))
        count = self.weights.size
        own, cross = np.ones(part.coherence.size), np.ones(part.coherence.size)
        for axis in (0, 1):
            place = (np.arange(count) - (count - 1) / 2) * spacing[axis]
            fringes = 2 * np.pi * part.fringes[axis][:, None]
            alike, crossed = np.zeros(own.size), np.zeros(own.size)
            for weight, here in zip(self.weights, place, strict=True):
                first, second = part.correlations(axis, here - place)
                alike += weight * (first * np.cos(fringes * (here - place))) @ self.weights
                crossed += weight * (second * np.cos(fringes * (here + place))) @ self.weights
            own, cross = own * alike, cross * crossed
        found = part.combine(own, cross).reshape(rows.size, columns.size)
        covered = _separable(np.ones(shape), self.weights)
        return np.asarray(_interpolate(found, rows, columns, shape) / covered)

    def neighbours(self, noise: Decorrelation, spacing: tuple[float, float]) -> Floats:
        """Return the correlation of a pixel's noise with its neighbour's, as in `Response`."""
        if self.weights.size > 1:
            return np.ones(noise.coherence.shape)
        whole = noise.at(tuple(np.indices(noise.coherence.shape)))
        lag = np.array([0.0, spacing[1]])
        own, cross = whole.correlations(1, lag)
        left = own - (whole.thermal**2)[:, None] * cross
        ratio = left[:, 1] / np.maximum(left[:, 0], np.finfo(float).tiny)
        return np.clip(ratio, 0, 1).reshape(noise.coherence.shape)


class Goldstein:
    """Goldstein's filter with the weights that it found.

    Patches overlap by half here, which is enough for what changes from patch to patch.

    Parameters
    ----------
    interferogram
        What was filtered (y, x).
    alpha, patch_px
        As in `filtering.goldstein`.
    """

    follows_amplitude = False

    def __init__(self, interferogram: Complexes, *, alpha: float, patch_px: int) -> None:
        from vinsar.kernels import patches as kernel

        step = next(n for n in range(patch_px // 4, 0, -1) if patch_px % n == 0)
        self.patches = Patches(interferogram.shape, patch_px, step)
        spectra = self._spectra(interferogram)
        self.weights = np.empty(spectra.shape, np.float32)
        kernel.weigh(spectra, alpha, self.weights)

    def _spectra(self, values: Complexes) -> Complexes:
        return self.patches.spectra(self.patches.padded(values), 0, self.patches.across)

    def apply(self, values: Complexes) -> Complexes:
        """Return values (y, x) filtered with these weights."""
        spectra = self._spectra(values)
        spectra *= self.weights
        return self.patches.image([self.patches.band(spectra)], [0])

    def gain(
        self, noise: Decorrelation, shape: tuple[int, int], spacing: tuple[float, float]
    ) -> Floats:
        """Return the noise that is left over the noise that went in, as in `Response`.

        The sum over the patch's frequencies of its squared weights times the noise's spectrum.
        """
        patches = self.patches
        part = noise.at(np.ix_(*patches.centers()))
        lag = np.fft.fftfreq(patches.side) * patches.side
        overlap = 1 - np.abs(lag) / patches.side
        own, cross = (
            [
                np.fft.fft(values * overlap, axis=1).real.reshape(
                    patches.down, patches.across, patches.side
                )
                / patches.side
                for values in pair
            ]
            for pair in zip(
                *(part.correlations(axis, lag * spacing[axis]) for axis in (1, 0)), strict=True
            )
        )
        power = self.weights**2
        sums = [
            np.einsum("jcir,ijr,ijc->ij", power, *pair, optimize=True).ravel()
            for pair in (own, cross)
        ]
        found = part.combine(*sums).reshape(patches.down, patches.across)
        left = patches.spread(found)
        # At the edges there is less to average: of as many pixels as it averages inside.
        cell = np.median(noise.resolution[0] * noise.resolution[1]) / (spacing[0] * spacing[1])
        reach = max(1, round(float(np.sqrt(cell / np.median(left)))))
        return np.asarray(left / _separable(np.ones(shape), np.full(reach, 1 / reach)))

    def neighbours(self, noise: Decorrelation, spacing: tuple[float, float]) -> Floats:
        """Return the correlation of a pixel's noise with its neighbour's, as in `Response`."""
        del spacing
        return np.ones(noise.coherence.shape)


def gaussian_weights(std_px: float) -> Floats:
    """Return the weights of `filtering.gaussian` along one axis, of sum 1."""
    reach = int(np.ceil(_REACH * std_px))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / std_px) ** 2)
    return np.asarray(weights / weights.sum())


def _separable(values: NDArray[Any], weights: Floats) -> NDArray[Any]:
    from scipy.ndimage import convolve1d

    def both(part: Floats) -> Floats:
        along = convolve1d(part, weights, axis=0, mode="constant")
        return np.asarray(convolve1d(along, weights, axis=1, mode="constant"))

    if np.iscomplexobj(values):
        return np.asarray(both(values.real) + 1j * both(values.imag))
    return both(np.asarray(values, float))


def _nodes(size: int) -> NDArray[np.integer]:
    return np.unique(np.append(np.arange(0, size, _NODE_PX), size - 1))


def _interpolate(
    values: Floats,
    rows: NDArray[np.integer],
    columns: NDArray[np.integer],
    shape: tuple[int, int],
) -> Floats:
    across = np.array([np.interp(np.arange(shape[1]), columns, line) for line in values])
    return np.array([np.interp(np.arange(shape[0]), rows, line) for line in across.T]).T


def rectangle_gain(
    noise: Decorrelation, shape: tuple[int, int], spacing: tuple[float, float]
) -> float:
    """Return the noise that the mean over a rectangle leaves over that of a pixel.

    Parameters
    ----------
    noise
        What decorrelates the pixel in its middle; its fringes do not count.
    shape
        Rows and columns.
    spacing
        Spacing of the pixels in x and y, m.
    """
    own, cross = 1.0, 1.0
    for axis, count in ((1, shape[0]), (0, shape[1])):
        lag = np.arange(1 - count, count)
        weight = (count - np.abs(lag)) / count**2
        first, second = noise.correlations(axis, lag * spacing[axis])
        own, cross = own * float((first @ weight)[0]), cross * float((second @ weight)[0])
    return float(noise.combine(np.array([own]), np.array([cross]))[0])
