"""Transforms of overlapping patches of an image, and the image that they add up to.

Neighbouring patches share most of their pixels, so each line across them is transformed once for
all of them along y, before and after: a third fewer transforms than of one patch after the other.
Arrays of patches are (patch along x, column, patch along y, row).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]


class Patches:
    """Square patches that cover an image, each pixel by as many as every other.

    Parameters
    ----------
    shape
        Rows and columns of the image.
    side
        Side of a patch, pixels.
    step
        Step between patches, pixels; it divides the side.

    Attributes
    ----------
    down, across
        How many patches there are along y and along x.
    """

    def __init__(self, shape: tuple[int, int], side: int, step: int) -> None:
        self.shape, self.side, self.step = shape, side, step
        self.lead = side - step
        self.down, self.across = (-(-(size + self.lead) // step) for size in shape)
        profile = np.sin(np.pi * (np.arange(side) + 0.5) / side) ** 2
        self.taper = profile.astype(np.float32)
        # Tapers squared-sine at a step that divides the patch add up to a constant.
        self._gain = (side / (2 * step)) ** 2

    def padded(self, image: Complexes) -> NDArray[np.complex64]:
        """Return the image (x, y) with zeros around it, which `spectra` takes."""
        found = np.zeros([self._size(count) for count in (self.across, self.down)], np.complex64)
        self._inside(found)[:] = image.T
        return found

    def spectra(self, padded: NDArray[np.complex64], begin: int, end: int) -> Complexes:
        """Return the spectra of the patches from one number along x to another."""
        from scipy import fft

        view = np.lib.stride_tricks.sliding_window_view
        columns = view(padded, self.side, axis=0)[:: self.step][begin:end]
        lines = fft.fft(columns.transpose(0, 2, 1), axis=1)
        rows = view(lines, self.side, axis=2)[:, :, : self.down * self.step : self.step]
        return np.asarray(fft.fft(rows, axis=3))

    def band(self, spectra: Complexes) -> NDArray[np.complex64]:
        """Return what the tapered patches of some spectra add up to (x, y); spectra are lost."""
        from scipy import fft

        from vinsar.kernels import patches as kernel

        parts = fft.ifft(spectra, axis=3, overwrite_x=True)
        lines = np.zeros((len(parts), self.side, self._size(self.down)), np.complex64)
        kernel.add_along_y(parts, self.taper, self.step, lines)
        lines = fft.ifft(lines, axis=1, overwrite_x=True)
        found = np.zeros((self._size(len(parts)), lines.shape[2]), np.complex64)
        kernel.add_along_x(lines, self.taper, self.step, found)
        return found

    def image(self, bands: list[NDArray[np.complex64]], begins: list[int]) -> Complexes:
        """Return the image (y, x) that bands add up to which begin at some patches along x."""
        total = np.zeros([self._size(count) for count in (self.across, self.down)], np.complex64)
        for begin, band in zip(begins, bands, strict=True):
            total[begin * self.step : begin * self.step + len(band)] += band
        return np.asarray(self._inside(total).T / np.float32(self._gain))

    def centers(self) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
        """Return the rows and the columns in the patches' middles, those in the image at least."""
        rows, columns = (
            np.clip(np.arange(count) * self.step + self.side // 2 - self.lead, 0, size - 1)
            for count, size in zip((self.down, self.across), self.shape, strict=True)
        )
        return rows, columns

    def spread(self, values: Floats) -> Floats:
        """Return the image (y, x) of patches that are each one of some values (down, across)."""
        along, across = (
            self._tapers(count, size)
            for count, size in zip((self.down, self.across), self.shape, strict=True)
        )
        return np.asarray(along.T @ values @ across / self._gain)

    def _tapers(self, count: int, size: int) -> Floats:
        found = np.zeros((count, self._size(count)))
        for number, line in enumerate(found):
            line[number * self.step : number * self.step + self.side] = self.taper
        return found[:, self.lead : self.lead + size]

    def _size(self, count: int) -> int:
        return (count - 1) * self.step + self.side

    def _inside(self, padded: NDArray[np.complex64]) -> NDArray[np.complex64]:
        rows, columns = self.shape
        return padded[self.lead : self.lead + columns, self.lead : self.lead + rows]
