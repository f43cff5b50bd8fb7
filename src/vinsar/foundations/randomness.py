"""Random draws: each has a seed of its own, whatever else is drawn, where or in which order."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from vinsar.foundations.configuration import Study

KEYS = ("seed", "realization")
"""Keys of the configuration that a draw depends on."""


class Draw(IntEnum):
    """What a draw is for; the number is part of its seed and never changes."""

    JITTER = 0
    NOISE = 1
    MOTION = 2
    BASELINE = 3
    ROUGHNESS = 4
    COUPLING = 5
    SPEED = 6


def generator(study: Study, draw: Draw, *part: int) -> np.random.Generator:
    """Return the generator of a draw.

    Parameters
    ----------
    study
        A study with `KEYS`.
    draw
        What it is for.
    part
        Which of several, such as the channel.

    Returns
    -------
    numpy.random.Generator
        The same for the same seed, realization, purpose and part.
    """
    key = (study.realization, int(draw), *part)
    return np.random.default_rng(np.random.SeedSequence(study.seed, spawn_key=key))
