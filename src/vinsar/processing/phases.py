"""Phases of complex images, ten times as fast as numpy has them, which takes them one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]


def angle(values: Complexes) -> Floats:
    """Return the phases of complex values, rad, in double precision; 0 where there is nothing."""
    from vinsar.kernels import phases

    found = np.empty(values.shape)
    phases.of(_parts(values), found.reshape(-1))
    return found


def unit(values: Complexes) -> Complexes:
    """Return complex values of the same phase and of magnitude 1; 0 where there is nothing."""
    from vinsar.kernels import phases

    found = np.empty(values.shape, complex)
    phases.unit(_parts(values), found.reshape(-1).view(float))
    return found


def rotation(phase: Floats) -> NDArray[np.complex64]:
    """Return exp(-i phase) in single precision, which a phase of many cycles needs only after."""
    from vinsar.kernels import phases

    found = np.empty(phase.shape, np.complex64)
    phases.rotation(np.ascontiguousarray(phase, float).reshape(-1), found.reshape(-1))
    return found


def _parts(values: Complexes) -> Floats:
    return np.ascontiguousarray(values, complex).reshape(-1).view(float)
