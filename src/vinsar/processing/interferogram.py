"""The interferogram of two images and its coherence (Eq. 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray


def coherence(
    lower: NDArray[np.complexfloating], upper: NDArray[np.complexfloating], window_px: int
) -> NDArray[np.floating]:
    """Return the magnitude of the multilooked complex coherence.

    Parameters
    ----------
    lower, upper
        Images of one shape (y, x).
    window_px
        Side of the square boxcar, odd; at the edges it covers what there is.

    Returns
    -------
    ndarray, shape (y, x)
        Coherence from 0 to 1; 0 where an image is zero all over the window.

    Raises
    ------
    ValueError
        If the window is not odd and positive.
    """
    from vinsar.kernels import multilook

    if window_px < 1 or window_px % 2 == 0:
        raise ValueError(f"the coherence window of {window_px} pixels must be odd and positive")
    result = np.empty(lower.shape)
    multilook.coherence(
        np.ascontiguousarray(lower), np.ascontiguousarray(upper), window_px // 2, result
    )
    return result


def form(images: xr.Dataset, *, coherence_window_px: int) -> xr.Dataset:
    """Form the interferogram, lower times conjugate upper (Eq. 10), and its coherence.

    Parameters
    ----------
    images
        Product ``images``.
    coherence_window_px
        Side of the multilook window of the coherence, odd.

    Returns
    -------
    xarray.Dataset
        Product ``interferogram``.
    """
    lower = images["image"].sel(channel="lower").values
    upper = images["image"].sel(channel="upper").values
    return variables.dataset(
        "interferogram",
        {
            "interferogram": lower * np.conj(upper),
            "coherence": coherence(lower, upper, coherence_window_px),
        },
        {"x": images["x"].values, "y": images["y"].values},
    )
