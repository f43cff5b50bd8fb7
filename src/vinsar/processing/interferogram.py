"""The interferogram of two images and its coherence (Eq. 10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vinsar.foundations import variables
from vinsar.foundations.configuration import Section, key
from vinsar.foundations.errors import Fault
from vinsar.foundations.stage import Stage
from vinsar.foundations.variables import GRID, Variable
from vinsar.radar import grid, instrument, waveform
from vinsar.radar.instrument import Instrument

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from numpy.typing import NDArray

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products


LOOKS_KEYS = (*waveform.KEYS, *grid.KEYS, "interferogram")
"""Keys of the configuration that `looks` depends on."""

variables.declare(
    "interferogram",
    {
        "interferogram": Variable(
            GRID, "complex", "1", "interferogram, lower times conjugate upper (Eq. 10)"
        ),
        "coherence": Variable(
            GRID,
            "real",
            "1",
            "multilooked coherence magnitude",
            bounds=(0, 1),
        ),
    },
)


class Interferogram(Section, name="interferogram"):
    """Interferogram and coherence."""

    coherence_window_px: int = key(
        "side of the multilook window of the coherence, odd", "not mentioned", ge=1
    )


def coherence(
    lower: NDArray[np.complexfloating], upper: NDArray[np.complexfloating], window_px: int
) -> NDArray[np.floating]:
    """Return the magnitude of the multilooked complex coherence.

    Parameters
    ----------
    lower, upper
        Images of one shape (y, x), NaN where there is none.
    window_px
        Side of the square boxcar, odd; at the edges, and where an image is NaN, it covers what
        there is.

    Returns
    -------
    ndarray, shape (y, x)
        Coherence from 0 to 1; 0 where an image is zero all over the window, NaN where it is NaN.

    Raises
    ------
    ValueError
        If the window is not odd and positive.
    """
    from vinsar.kernels import multilook

    if window_px < 1 or window_px % 2 == 0:
        raise ValueError(f"the coherence window of {window_px} pixels must be odd and positive")
    result = np.empty(lower.shape)
    known = np.isfinite(lower) & np.isfinite(upper)
    if not known.all():
        lower, upper = np.where(known, lower, 0), np.where(known, upper, 0)
    multilook.coherence(
        np.ascontiguousarray(lower), np.ascontiguousarray(upper), window_px // 2, result
    )
    result[~known] = np.nan
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


def looks(antennas: xr.Dataset, study: Study) -> float:
    """Return the effective number of looks of the coherence.

    Those of the multilook window at the middle of the image (`Instrument.looks`).

    Parameters
    ----------
    antennas
        Product ``trajectory``.
    study
        The configuration.
    """
    side = study.interferogram.coherence_window_px * grid.pixel_side(study.imaging)
    given = Instrument.of(antennas, waveform.sampled(study.radar))
    return float(given.looks(side, *instrument.middle(study.imaging)))


def _interferogram(products: Products, study: Study) -> xr.Dataset:
    return form(products["images"], coherence_window_px=study.interferogram.coherence_window_px)


def _odd_window(interferogram: Interferogram) -> Iterator[Fault]:
    window = interferogram.coherence_window_px
    if window % 2 == 0:
        yield Fault("interferogram.coherence_window_px", window, "must be odd")


def of_two(study: Study) -> bool:
    """Tell whether a study has two channels; a measurement may have one."""
    return study.measurement.channels != 1


STAGES = {
    "interferogram": Stage(
        _interferogram, inputs=("images",), sections=("interferogram",), when=of_two
    ),
}


CHECKS = (_odd_window,)
