"""The noise of an interferometric phase: coherence, looks, standard deviation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.floating]


def noise_coherence(snr_db: ArrayLike) -> Floats:
    """Return the coherence that thermal noise leaves, ``1 / (1 + 1 / SNR)``."""
    return 1 / (1 + 10 ** (-np.asarray(snr_db, float) / 10))


def phase_std(coherence: ArrayLike, looks: ArrayLike) -> Floats:
    """Return the Cramer-Rao bound of the interferometric phase's standard deviation, rad.

    ``sqrt((1 - gamma^2) / (2 N gamma^2))`` (Rodriguez and Martin 1992). It is reached with many
    looks and high coherence; without coherence it is infinite.

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
