"""What the vehicle's speed is told by, and when echoes tell nothing of it."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import vinsar
from vinsar.processing import speed
from vinsar.radar import motion, trajectory, waveform
from vinsar.simulation import echo
from vinsar.study import pipeline

EXTENT = (-1.0, 1.0, 10.0, 12.0)
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
SCAN = {"extent": EXTENT, "duration_s": 0.5}


def seen(antennas, scatterers):
    rng = np.random.default_rng(0)
    places = np.zeros((300, 3))
    places[:, 0] = rng.uniform(*EXTENT[:2], 300)
    places[:, 1] = rng.uniform(*EXTENT[2:], 300)
    return echo.simulate(scatterers(places), antennas, frequency=FREQUENCY, accuracy_db=-60.0)


def noise(like):
    parts = np.random.default_rng(1).standard_normal((*like["echo"].shape, 2))
    return like.assign(echo=like["echo"].copy(data=parts.view(complex)[..., 0]))


def without_one(like):
    values = like["echo"].values.copy()
    values[:, 7] = 0
    return like.assign(echo=like["echo"].copy(data=values))


def short(antennas, positions=12):
    return antennas.isel(position=slice(positions))


@pytest.fixture(scope="module")
def driven(rail):
    return motion.advance(rail, speed_m_per_s=4.0, duration_s=0.5)


@pytest.fixture(scope="module")
def received(driven, scatterers):
    return seen(driven, scatterers)


CASES = {
    "exact": "exact",
    "few": "12 positions are too few",
    "silent": "have no echo",
    "noise": "clearly sharper",
    "standing": "too slow",
}


@pytest.mark.parametrize(("case", "reason"), CASES.items(), ids=CASES)
def test_echoes_that_tell_nothing_are_refused_with_the_reason(
    received, driven, rail, caplog, case, reason
):
    heard, told, std = received, driven, 0.0 if case == "exact" else 0.1
    if case == "few":
        heard, told = short(heard), short(told)
    elif case == "silent":
        heard = without_one(heard)
    elif case == "noise":
        heard = noise(heard)
    elif case == "standing":
        told = rail
    with caplog.at_level(logging.WARNING):
        found = speed.estimate(heard, told, sensor_std_m_per_s=std, **SCAN)
    assert reason in found.reason
    assert [found.correction, found.std] == [0, std]
    assert found.reason in caplog.records[-1].getMessage()


def test_the_way_is_the_vehicle_s(rail):
    moved = trajectory.displaced(rail, speed.way(2.5, positions=81, duration_s=0.4))
    driven = motion.advance(rail, speed_m_per_s=2.5, duration_s=0.4)
    for name in ("transmitter", "receiver"):
        np.testing.assert_allclose(moved[name], driven[name], atol=1e-15)


def test_imaging_gets_the_corrected_speed_from_the_stage(received, driven, monkeypatch):
    study = vinsar.load(
        vehicle={
            "speed_correction": "echoes", "speed_error_m_per_s": 0.1,
            "forward_speed_m_per_s": 4.0, "scan_duration_s": 0.5,
        },
        echo={"snr_db": None},
    )  # fmt: skip
    told = []

    def estimate(*_, **options):
        told.append(options)
        return speed.Speed(-0.3, 0.01)

    monkeypatch.setattr(speed, "estimate", estimate)
    given = {"received": received, "recorded_trajectory": driven}
    found = pipeline.run_stage("autofocus", given, study)
    moved = trajectory.displaced(driven, found["displacement"].values)
    slower = motion.advance(driven, speed_m_per_s=-0.3, duration_s=0.5)
    np.testing.assert_allclose(moved["receiver"], slower["receiver"], atol=1e-12)
    # What is left is the same for both channels: no error of the phase between them.
    assert not found["displacement_std"].values.any()
    assert told == [
        {"extent": (-2.5, 2.5, 10.0, 16.0), "duration_s": 0.5, "sensor_std_m_per_s": 0.1}
    ]
