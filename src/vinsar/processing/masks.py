"""Where an image has values at all: pixels that are not a number tell nothing, and stay so."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Flags = NDArray[np.bool_]
    Values = NDArray[Any]


def average(smooth: Callable[[Values], Values], values: Values) -> Values:
    """Apply a linear filter to the pixels that have values.

    Parameters
    ----------
    smooth
        A weighted average, from an image (y, x) to one of its shape.
    values
        Image (y, x), real or complex, NaN where there is none.

    Returns
    -------
    ndarray, shape (y, x)
        The average over the pixels that have values; NaN where the image has none.
    """
    known = np.isfinite(values)
    if known.all():
        return smooth(values)
    total = smooth(np.where(known, values, 0))
    weight = smooth(known.astype(values.dtype)).real
    # Of a pixel that is known its own weight at least is there.
    return np.divide(total, weight, out=np.full_like(total, np.nan), where=known)


def fill(values: Values) -> Values:
    """Return values (y, x) with the nearest finite one where there is none.

    Parameters
    ----------
    values
        Values (y, x), one of them finite at least.
    """
    from scipy.ndimage import distance_transform_edt

    known = np.isfinite(values)
    if known.all():
        return values
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])


def islands(known: Flags) -> tuple[NDArray[np.integer], int]:
    """Return the number of each pixel's island, from 1 on, 0 where nothing is known, and how many.

    Pixels of one island are joined by their sides, along which phases are unwrapped.

    Parameters
    ----------
    known
        Pixels that have values (y, x).
    """
    from scipy.ndimage import label

    numbers, count = label(known)
    return numbers, int(count)
