"""What a filter of the interferogram does to signal and to noise.

Each filter is linear, or nearly so once its weights are known (Goldstein's follow from the data).
What it leaves of the noise follows from its weights and the noise's correlation
(`vinsar.radar.decorrelation`), and what it takes from the signal from applying it again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
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

# Frequencies along an axis over which rough ground is summed, and the least power that counts.
_BINS, _LEAST_POWER = 64, 1e-3


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

    def taken(self, ground: Rough, shape: tuple[int, int]) -> Floats:
        """Return the mean square of what cell and filter take from rough ground (y, x).

        With C the cell's transfer, W the filter's and S the ground's spectrum around the local
        fringe, the sum of ``S (1 - W C)^2``.

        Parameters
        ----------
        ground
            Rough ground of unit variance.
        shape
            Shape of the image.
        """
        ...


@dataclass(frozen=True)
class Rough:
    """Ground of a Gaussian autocorrelation, less its mean over a window; of unit variance.

    Attributes
    ----------
    correlation_m
        Distance at which the correlation has fallen to 1/e, m.
    cell_m
        Resolution in x and y, over which an image averages it, m.
    spacing
        Spacing of the pixels in x and y, m.
    window_px
        Rows and columns of the window whose mean is taken away.
    """

    correlation_m: float
    cell_m: tuple[float, float]
    spacing: tuple[float, float]
    window_px: tuple[int, int]

    def spectra(self, count: int) -> tuple[Floats, Floats]:
        """Return its power spectrum, of sum 1, and the resolution cell's transfer.

        Both over so many frequencies along either axis, in the order of an FFT (y, x). A cell of
        the power ``sinc^2(d / rho)`` has the transfer ``1 - |k| rho``.
        """
        power, cell, kept = [], [], []
        for resolution, spacing, side in zip(
            self.cell_m, self.spacing, self.window_px[::-1], strict=True
        ):
            k = np.fft.fftfreq(count, spacing)
            power.append(np.exp(-((np.pi * self.correlation_m * k) ** 2)))
            cell.append(np.maximum(0, 1 - np.abs(k) * resolution))
            place = np.arange(side) - side // 2
            kept.append(np.cos(2 * np.pi * np.outer(k * spacing, place)).mean(axis=1))
        left = np.outer(*power[::-1]) * (1 - np.outer(*kept[::-1])) ** 2
        return left / left.sum(), np.outer(*cell[::-1])

    def correlation(self, count: int) -> Floats:
        """Return the covariance of an image's pixels over so many distances, as of an FFT."""
        return _correlation(self, count)


# Frame after frame asks for the same.
@lru_cache(maxsize=16)
def _correlation(ground: Rough, count: int) -> Floats:
    power, cell = ground.spectra(count)
    return np.asarray(np.fft.fft2(power * cell**2).real)


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

    def taken(self, ground: Rough, shape: tuple[int, int]) -> Floats:
        """Return what cell and average take from rough ground, as in `Response`."""
        power, cell = ground.spectra(_BINS)
        place = np.arange(self.weights.size) - self.weights.size // 2
        along = np.cos(2 * np.pi * np.outer(np.fft.fftfreq(_BINS), place)) @ self.weights
        lost = (power * (1 - np.outer(along, along) * cell) ** 2).sum()
        return np.full(shape, float(lost))


class Goldstein:
    """Goldstein's filter with the weights that it found.

    Patches overlap by half here, whatever the filter's own do.

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

        step = next(n for n in range(patch_px // 2, 0, -1) if patch_px % n == 0)
        self.patches = Patches(interferogram.shape, patch_px, step)
        spectra = self._spectra(interferogram)
        power = (spectra.real**2 + spectra.imag**2).transpose(0, 2, 1, 3)
        strongest = power.reshape(*power.shape[:2], -1).argmax(axis=2)
        # Column and row (patch along x, patch along y) of the strongest line of each spectrum.
        self.fringe = np.stack(np.divmod(strongest, patch_px))
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
        from vinsar.kernels import patches as kernel

        patches = self.patches
        part = noise.at(np.ix_(*patches.centers()))
        lag = np.fft.fftfreq(patches.side) * patches.side
        overlap = (1 - np.abs(lag) / patches.side) / patches.side
        rows, columns = (
            np.stack(
                [
                    np.fft.fft(values * overlap, axis=1).real
                    for values in part.correlations(axis, lag * spacing[axis])
                ],
            ).reshape(2, patches.down, patches.across, patches.side)
            for axis in (1, 0)
        )
        sums = np.empty((2, patches.down, patches.across))
        kernel.left(self.weights, rows, columns, sums)
        found = part.combine(*sums.reshape(2, -1)).reshape(patches.down, patches.across)
        left = patches.spread(found)
        # At the edges there is less to average: of as many pixels as it averages inside.
        cell = np.median(noise.resolution[0] * noise.resolution[1]) / (spacing[0] * spacing[1])
        reach = max(1, round(float(np.sqrt(cell / np.median(left)))))
        return np.asarray(left / _separable(np.ones(shape), np.full(reach, 1 / reach)))

    def neighbours(self, noise: Decorrelation, spacing: tuple[float, float]) -> Floats:
        """Return the correlation of a pixel's noise with its neighbour's, as in `Response`."""
        del spacing
        return np.ones(noise.coherence.shape)

    def taken(self, ground: Rough, shape: tuple[int, int]) -> Floats:
        """Return what cell and patches take from rough ground, as in `Response`.

        A patch passes a phase as it passes its two sidebands against the fringe, the strongest
        line of its spectrum.
        """
        from vinsar.kernels import patches as kernel

        del shape
        power, cell = ground.spectra(self.patches.side)
        rows, columns = np.nonzero(power > _LEAST_POWER * power.max())
        lost = np.empty((self.patches.down, self.patches.across))
        kernel.sidebands(
            self.weights,
            self.fringe,
            rows,
            columns,
            power[rows, columns],
            cell[rows, columns],
            lost,
        )
        return self.patches.spread(lost)


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
