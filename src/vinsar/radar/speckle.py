"""The noise of an interferometric phase: from coherence and looks to its standard deviation."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]

# Nodes of the integral over the phase, denser towards its middle, and the looks up to which the
# distribution is evaluated: beyond, it is normal.
_NODES, _DENSER = 64, 3
_MOST_LOOKS = 1000.0

# Coherences closer to 1 are as good as 1.
_FULL = 1 - 1e-12


@cache
def _nodes() -> tuple[Floats, Floats]:
    """Return phases from 0 to pi, and what they weigh in a sum that is to be normalised."""
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    node = (node + 1) / 2
    return np.pi * node**_DENSER, weight * node ** (_DENSER - 1)


def pixel_coherence(
    geometric: ArrayLike,
    snr_db: ArrayLike,
    filled: ArrayLike,
    focused: ArrayLike = 1.0,
    alike: ArrayLike = 0.0,
) -> NDArray[Any]:
    """Return the coherence of a pixel that decorrelation, thermal noise and defocusing leave.

    The signal-to-noise ratio is that of a range cell, whose echo comes from all of the scene's
    width. Focusing gathers the signal in the share w of the unambiguous width that the scene fills
    and leaves the noise everywhere, so a pixel has the ratio SNR / w. White position errors leave
    the share s of a target's power in focus and spread the rest over the unambiguous width, where
    other targets' fill the pixel. Of these the two images share a part a, with the phase that the
    pixel's own place does not explain:

        gamma = gamma_geo (s + (1 - s) w a) / (s + (1 - s) w + w / SNR).

    Parameters
    ----------
    geometric
        Coherence that the baseline leaves, 0 to 1.
    snr_db
        Signal-to-noise ratio of a range cell, dB; infinite without noise.
    filled
        Share w of the unambiguous width that the scene fills (`instrument.Instrument.filled`).
    focused
        Share s of a target's power in focus.
    alike
        Coherence a of what is spread: 0 for errors of each channel's own, complex for common ones.

    Returns
    -------
    ndarray
        Coherence, complex if `alike` is.
    """
    noise = 10 ** (-np.asarray(snr_db, float) / 10)
    focused, filled = np.asarray(focused, float), np.asarray(filled, float)
    spread = (1 - focused) * np.minimum(filled, 1)
    shared = focused + spread * np.asarray(alike)
    return np.asarray(np.asarray(geometric) * shared / (focused + spread + filled * noise))


def phase_bound(coherence: ArrayLike, looks: ArrayLike) -> Floats:
    """Return the Cramer-Rao bound of the interferometric phase's standard deviation, rad.

    ``sqrt((1 - gamma^2) / (2 N gamma^2))`` (Rodriguez and Martin 1992). Many looks reach it; a
    single one does not (`phase_std`). Without coherence it is infinite.

    Parameters
    ----------
    coherence
        Coherence gamma, 0 to 1.
    looks
        Number N of independent looks.

    Returns
    -------
    ndarray
        Standard deviation, rad.
    """
    gamma = np.asarray(coherence, float)
    with np.errstate(divide="ignore"):
        return np.sqrt((1 - gamma**2) / (2 * np.asarray(looks, float))) / gamma


def phase_std(coherence: ArrayLike, looks: ArrayLike) -> Floats:
    """Return the standard deviation of the interferometric phase of multilooked speckle, rad.

    From the distribution of the phase of N averaged looks (Lee and others 1994), with
    ``beta = gamma cos(phi)`` and Euler's transform of its hypergeometric function

        p = ((1 - gamma^2) / (1 - beta^2))^N / (2 pi sqrt(1 - beta^2))
            * (2F1(1/2 - N, -1/2; 1/2; beta^2) + sqrt(pi) beta Gamma(N + 1/2) / Gamma(N)),

    which holds for any real N. Many looks reach the Cramer-Rao bound (`phase_bound`); without
    coherence it is the ``pi / sqrt(3)`` of a phase that is uniform over a cycle.

    Parameters
    ----------
    coherence
        Coherence gamma, 0 to 1.
    looks
        Number N of independent looks, 1 or more; shapes broadcast.

    Returns
    -------
    ndarray
        Standard deviation, rad.
    """
    from scipy.special import gammaln, hyp2f1

    phase, weight = _nodes()
    gamma, count = np.broadcast_arrays(
        np.minimum(np.asarray(coherence, float), _FULL), np.asarray(looks, float)
    )
    few = np.minimum(count, _MOST_LOOKS)[..., None]
    square = gamma[..., None] ** 2
    beta = gamma[..., None] * np.cos(phase)
    rest = 1 - beta**2
    ratio = np.exp(gammaln(few + 0.5) - gammaln(few))
    density = np.exp(few * np.log((1 - square) / rest)) / np.sqrt(rest)
    density *= hyp2f1(0.5 - few, -0.5, 0.5, beta**2) + np.sqrt(np.pi) * beta * ratio
    variance = (density * phase**2) @ weight / (density @ weight)
    return np.asarray(np.sqrt(variance * few[..., 0] / count))
