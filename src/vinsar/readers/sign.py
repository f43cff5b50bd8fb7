"""The sign of the echo's phase, told by what the antennas' path makes of it.

With the wrong sign a target at the range ``R`` appears at the unambiguous range less ``R``, with
the curvature of its path reversed: it does not focus. So with targets that stand out the sharper
image has the right sign. Where there are none, as on ground of speckle alone, two channels tell:
with the wrong sign twice the flat earth's phase is left between them, so that they are less
coherent. With a short baseline that is little, and coherence alone decides nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from vinsar.foundations import variables
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.floating]
    Complexes = NDArray[np.complexfloating]

Verdict = Literal["right", "wrong", "undecided"]

# A verdict needs the one contrast to be this many times the other, or the one coherence to be this
# much higher: with a baseline too short to tell, the coherences differ by a hundredth or two.
_CLEAR_CONTRAST, _CLEAR_COHERENCE = 1.5, 0.1

# Side of the image that is tried, in pixels, and how many of the brightest are averaged.
_SIDE, _BRIGHTEST = 301, 5

_WINDOW_PX = 7


@dataclass(frozen=True)
class SignTest:
    """Which sign focuses.

    Attributes
    ----------
    verdict
        Whether the phase ``-2 pi f R / c`` holds.
    contrast
        Power of the brightest pixels over the mean power of an image of all that is in the
        unambiguous range, with the sign as it is and with the opposite one.
    coherence
        Mean coherence of the first two channels, weighted by power, with either sign; None for one
        channel.
    """

    verdict: Verdict
    contrast: tuple[float, float]
    coherence: tuple[float, float] | None

    @property
    def sentence(self) -> str:
        """The result in words."""
        found = (
            f"the brightest pixels are {self.contrast[0]:.3g} times as strong as the mean with the "
            f"sign as it is, {self.contrast[1]:.3g} times with the opposite one"
        )
        if self.coherence is not None:
            found += f"; coherence {self.coherence[0]:.2f} and {self.coherence[1]:.2f}"
        return {
            "right": f"sign of the phase: right ({found})",
            "wrong": f"sign of the phase: WRONG ({found}); give the other sign",
            "undecided": f"sign of the phase: undecided ({found}); see whether images focus",
        }[self.verdict]


def compare(
    samples: Complexes,
    frequency: Floats,
    transmitter: Floats,
    receiver: Floats,
    *,
    scene_m: tuple[float, float] | None = None,
) -> SignTest:
    """Image an echo with either sign of its phase, and compare the images.

    Parameters
    ----------
    samples
        Echo (channel, position, frequency), of which the first two channels are used.
    frequency
        Frequencies, Hz.
    transmitter, receiver
        Antenna positions (channel, position, axis), m, the aperture along x, y ahead.
    scene_m
        Middle of the scene, m, which is needed if the scene is beyond the unambiguous range.

    Returns
    -------
    SignTest
        The verdict and what it rests on.
    """
    samples = samples[:2]
    ends = {"transmitter": transmitter[:2], "receiver": receiver[:2]}
    # What is common to all positions is the coupling, which has no path.
    moving = samples - samples.mean(axis=1, keepdims=True)
    x, y = _axes(frequency, (ends["transmitter"] + ends["receiver"]).reshape(-1, 3) / 2, scene_m)
    channels = ["lower", "upper"][: len(samples)]
    antennas = variables.dataset("trajectory", ends, {"channel": channels})
    found = []
    for values in (moving, moving.conj()):
        echo = xr.Dataset(
            {"echo": (("channel", "position", "frequency"), values)},
            {"channel": channels, "frequency": frequency},
        )
        found.append(_image(echo, antennas, x, y))
    as_is, opposite = found
    contrast = max(map(_contrast, as_is)), max(map(_contrast, opposite))
    coherence = None
    if len(samples) == 2:
        coherence = _coherence(*as_is), _coherence(*opposite)
    verdict = _verdict(np.log(contrast[0] / contrast[1]) / np.log(_CLEAR_CONTRAST))
    if verdict == "undecided" and coherence is not None:
        verdict = _verdict((coherence[0] - coherence[1]) / _CLEAR_COHERENCE)
    return SignTest(verdict, contrast, coherence)


def _image(echo: xr.Dataset, antennas: xr.Dataset, x: Floats, y: Floats) -> Complexes:
    near, far = trajectory.range_extent(antennas, x, y)
    margin = 0.01 * (far - near)
    profiles = focusing.compress(
        echo,
        near_range_m=max(0.0, near - margin),
        far_range_m=far + margin,
        window="hann",
        oversampling=8,
    )
    return focusing.backproject(profiles, antennas, x=x, y=y, window="hann")["image"].values


def _axes(
    frequency: Floats, antennas: Floats, scene_m: tuple[float, float] | None
) -> tuple[Floats, Floats]:
    """Return the axes of an image that fills most of the unambiguous range."""
    step = float(frequency[-1] - frequency[0]) / (frequency.size - 1)
    reach = 0.9 * waveform.unambiguous_range(step)
    if scene_m is not None:
        side = depth = reach / 3
        middle = scene_m
    else:
        center, half = antennas.mean(axis=0), float(np.ptp(antennas[:, 0])) / 2
        side = reach / 2.5
        square = reach**2 - (side + half) ** 2 - center[2] ** 2
        depth = float(np.sqrt(max(square, (reach / 4) ** 2))) / 2
        middle = float(center[0]), float(antennas[:, 1].max()) + depth + 0.01 * reach
    return (
        np.linspace(middle[0] - side, middle[0] + side, _SIDE),
        np.linspace(middle[1] - depth, middle[1] + depth, _SIDE),
    )


def _contrast(image: Complexes) -> float:
    power = np.abs(image.ravel()) ** 2
    return float(np.sort(power)[-_BRIGHTEST:].mean() / power.mean())


def _coherence(one: Complexes, two: Complexes) -> float:
    from scipy.ndimage import uniform_filter

    def multilook(values: Floats) -> Floats:
        return np.asarray(uniform_filter(values, _WINDOW_PX))

    cross = one * two.conj()
    joint = np.hypot(multilook(cross.real), multilook(cross.imag))
    power = np.sqrt(multilook(np.abs(one) ** 2) * multilook(np.abs(two) ** 2))
    return float(joint.sum() / power.sum())


def _verdict(evidence: float) -> Verdict:
    if abs(evidence) < 1:
        return "undecided"
    return "right" if evidence > 0 else "wrong"
