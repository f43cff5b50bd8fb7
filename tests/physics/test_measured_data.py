"""Real echoes of a hand-moved rail radar, against what was surveyed.

The files are not part of the repository; docs/own-data.md says where they are from.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from vinsar.foundations import variables
from vinsar.processing import calibration, focusing
from vinsar.radar import trajectory
from vinsar.readers import importing, sign

FOLDER = Path(os.environ.get("VINSAR_DATA", Path(__file__).parents[3] / "shared/data"))
PULSES, PASSES = FOLDER / "bwsi-pulses.nc", FOLDER / "bwsi-two-passes.nc"

pytestmark = pytest.mark.skipif(
    not (PULSES.is_file() and PASSES.is_file()),
    reason=f"the measured echoes are not in {FOLDER} (VINSAR_DATA names another folder)",
)


@pytest.fixture(scope="module")
def pulses():
    return importing.read("pulses", [PULSES], importing.Options(band_hz=(3.1e9, 4.8e9)))


@pytest.fixture(scope="module")
def echoes(pulses):
    return calibration.Echoes(
        pulses.echo, pulses.frequency, pulses.transmitter, pulses.receiver, pulses.time
    )


@pytest.fixture(scope="module")
def reflector():
    with xr.open_dataset(PULSES) as stored:
        return stored["reflector"].values


def brightest(echoes, place):
    """Return where the reflector is imaged, less its survey, in the plane of its height, m."""
    channel = {"channel": ["lower"]}
    antennas = variables.dataset(
        "trajectory", {"transmitter": echoes.transmitter, "receiver": echoes.receiver}, channel
    )
    x, y = (np.arange(at - 0.4, at + 0.4, 0.005) for at in place[:2])
    near, far = trajectory.range_extent(antennas, x, y, place[2])
    moving = echoes.samples - echoes.samples.mean(axis=1, keepdims=True)
    profiles = focusing.compress(
        xr.Dataset(
            {"echo": (("channel", "position", "frequency"), moving)},
            {"frequency": echoes.frequency, **channel},
        ),
        near_range_m=near - 0.2,
        far_range_m=far + 0.2,
        window="hann",
    )
    image = focusing.backproject(profiles, antennas, x=x, y=y, z=place[2])["image"].values[0]
    row, column = np.unravel_index(np.abs(image).argmax(), image.shape)
    return np.array([x[column], y[row]]) - place[:2]


def test_the_range_bias_is_found(echoes, reflector):
    found = calibration.from_reflector(echoes, reflector)
    # It is known as about 0.42 m; a range cell is 9 cm.
    assert found.range_bias_m.value == pytest.approx(0.42, abs=0.02)
    assert found.range_bias_m.std < 0.02
    assert abs(found.time_offset_s[0].value) < 0.05


def test_the_reflector_is_imaged_where_it_was_surveyed(echoes, reflector):
    found = calibration.from_reflector(echoes, reflector)
    assert np.abs(brightest(calibration.apply(echoes, found), reflector)).max() < 0.03


def test_half_of_the_positions_predict_the_other_half(echoes, reflector):
    even = np.arange(echoes.samples.shape[1]) % 2 == 0
    one = calibration.from_reflector(echoes, reflector, use=even)
    other = calibration.from_reflector(echoes, reflector, use=~even)
    assert one.range_bias_m.value == pytest.approx(other.range_bias_m.value, abs=0.005)
    rest = replace(
        echoes,
        samples=echoes.samples[:, ~even],
        transmitter=echoes.transmitter[:, ~even],
        receiver=echoes.receiver[:, ~even],
        time=echoes.time[~even],
    )
    assert np.abs(brightest(calibration.apply(rest, one), reflector)).max() < 0.03


def test_the_sign_of_the_pulses_is_right(pulses):
    found = pulses.echo, pulses.frequency, pulses.transmitter, pulses.receiver
    assert sign.compare(*found).verdict == "right"


def test_the_sign_is_told_where_coherence_does_not():
    found = importing.read("stepped", [PASSES], importing.Options())
    places = found.transmitter, found.receiver
    right = sign.compare(found.echo, found.frequency, *places)
    wrong = sign.compare(found.echo.conj(), found.frequency, *places)
    assert (right.verdict, wrong.verdict) == ("right", "wrong")
    assert abs(right.coherence[0] - right.coherence[1]) < 0.05
