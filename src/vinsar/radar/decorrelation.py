"""How the noise of an interferogram is correlated from pixel to pixel.

The interferogram ``Z = s1 conj(s2)`` of two circular Gaussian images has across its mean phase the
covariance

    C(d) = P^2 / 2 Re[rho11(d) conj(rho22(d)) - rho12(d) conj(rho21(d))],

rho the images' correlations over a distance d. An image is limited in band: a window of the
resolution rho_y (and as wide in the wavenumber as 1 / rho_y) has the correlation
``sinc(d / rho_y)``. Ground seen by two antennas is seen in two bands, apart by the fringe frequency
of the absolute phase (Gatelli et al. 1994). A share delta of the band is then not common, and

    rho11 conj(rho22) = cos(2 pi delta d) sinc^2(d),
    rho12 conj(rho21) = (1 - delta)^2 sinc((1 - delta)(d + eta)) sinc((1 - delta)(d - eta)),

d and eta in cells, eta the displacement of one image against the other. So the noise that the
baseline makes has next to nothing at low frequencies, and an average over many cells is better than
the Cramer-Rao bound of as many independent looks; thermal noise, and what a displacement makes, is
white over the band and has all of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]

# A coherence beyond these says no more than that there is none, or no noise.
_LEAST, _MOST = 0.02, 0.9999


@dataclass(frozen=True)
class Decorrelation:
    """What decorrelates two images, at each of some pixels.

    Attributes
    ----------
    coherence
        Coherence of the two images (pixel,), 0 to 1.
    shift
        Shares of the band in x and in y that are not common (2, pixel), 0 to 1.
    displacement
        Displacement of one image against the other along y, in resolution cells (pixel,).
    resolution
        Resolution in x and y (2, pixel), m.
    fringes
        Fringe frequency of the interferogram in x and y (2, pixel), cycles/m.
    """

    coherence: Floats
    shift: Floats
    displacement: Floats
    resolution: Floats
    fringes: Floats

    def at(self, where: tuple[NDArray[np.integer], ...]) -> Decorrelation:
        """Return the decorrelation of some of the pixels, by their indices."""

        def both(values: Floats) -> Floats:
            return np.stack([part[where].ravel() for part in values])

        return Decorrelation(
            coherence=self.coherence[where].ravel(),
            shift=both(self.shift),
            displacement=self.displacement[where].ravel(),
            resolution=both(self.resolution),
            fringes=both(self.fringes),
        )

    @property
    def geometric(self) -> Floats:
        """Coherence that shift and displacement leave (pixel,)."""
        shared = 1 - np.clip(self.shift, 0, 1)
        return np.asarray(shared[0] * shared[1] * np.abs(np.sinc(shared[1] * self.displacement)))

    @property
    def thermal(self) -> Floats:
        """Coherence that all else leaves (pixel,): thermal noise, volume, leakage of sidelobes."""
        total = np.clip(self.coherence, _LEAST, _MOST)
        return np.asarray(np.minimum(1.0, total / np.maximum(self.geometric, _LEAST)))

    def correlations(self, axis: int, lag_m: Floats) -> tuple[Floats, Floats]:
        """Return ``rho11 conj(rho22)`` and ``rho12 conj(rho21)`` along one axis, without noise.

        Parameters
        ----------
        axis
            0 for x, 1 for y.
        lag_m
            Distances (lag,), m.

        Returns
        -------
        tuple of ndarray, shape (pixel, lag)
            The two products; at lag 0 the first is 1 and the second the squared geometric
            coherence of this axis.
        """
        cells = lag_m / self.resolution[axis][:, None]
        lost = np.clip(self.shift[axis], 0, 1)[:, None]
        kept = 1 - lost
        own = np.cos(2 * np.pi * lost * cells) * np.sinc(cells) ** 2
        if axis == 0:
            return own, (kept * np.sinc(kept * cells)) ** 2
        moved = self.displacement[:, None]
        cross = kept**2 * np.sinc(kept * (cells + moved)) * np.sinc(kept * (cells - moved))
        return own, cross

    def combine(self, own: Floats, cross: Floats) -> Floats:
        """Return the noise that a filter leaves over the noise that it is given (pixel,).

        Parameters
        ----------
        own, cross
            The filter's sums over both axes of the first and of the second of `correlations`.
        """
        thermal = self.thermal
        left = own - thermal**2 * cross
        given = 1 - (thermal * self.geometric) ** 2
        return np.asarray(np.maximum(left, 0) / np.maximum(given, 1 - _MOST**2))
