"""The speed from two scans of one drive: how well it is found, and when it is refused."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import vinsar
from vinsar.processing import next_scan, speed
from vinsar.radar import motion, trajectory, waveform
from vinsar.simulation import echo
from vinsar.study import pipeline

EXTENT = (-0.8, 0.8, 10.0, 11.5)
FREQUENCY = waveform.frequencies(13e9, 15e9, 101)
WAVELENGTH = 299_792_458.0 / 14e9
TIMES = {"duration_s": 0.5, "interval_s": 0.6}
GROUND = {"wavelength_m": WAVELENGTH, "range_cell_m": 0.075, "incoherent": 0.05}
# What an estimate is trusted to at least: a twenty-fifth of a cell.
TRUSTED = 0.08 * WAVELENGTH / (8 * TIMES["duration_s"])


def scans(rail, speed_m_per_s, times=TIMES):
    """The positions of both scans."""
    return (
        motion.advance(rail, speed_m_per_s=speed_m_per_s, duration_s=times["duration_s"]),
        motion.return_scan(rail, speed_m_per_s=speed_m_per_s, **times),
    )


@pytest.fixture(scope="module")
def heard(rail, scatterers):
    """Hear dense speckle at some height above the ground plane from both scans of a drive."""

    def make(speed_m_per_s, height=0.0, seeds=(0, 0), times=TIMES):
        found = []
        for antennas, seed in zip(scans(rail, speed_m_per_s, times), seeds, strict=True):
            rng = np.random.default_rng(seed)
            low, high = np.array([-1.0, 9.7]), np.array([1.0, 11.8])
            places = np.full((3000, 3), height)
            places[:, :2] = rng.uniform(low, high, (3000, 2))
            facets = scatterers(places, rng.uniform(0.5, 1, 3000))
            found.append(echo.simulate(facets, antennas, frequency=FREQUENCY, accuracy_db=-85.0))
        return tuple(found)

    return make


def left(echoes, antennas, error, std=0.05, times=TIMES):
    """The speed's error after the correction, m/s, and what was found."""
    found = next_scan.estimate(echoes, antennas, sensor_std_m_per_s=std, extent=EXTENT, **times)
    return found.correction + error, found


@pytest.mark.parametrize(
    ("true", "error", "height"),
    [(0.0, 0.05, 0.0), (4.0, -0.13, 0.0), (4.0, 0.07, 0.3)],
    ids=["standing", "driving", "raised"],
)
def test_the_speed_is_found(rail, heard, true, error, height):
    """Ground raised by 0.3 m would be taken for 26 mm/s if it counted as level."""
    rest, found = left(heard(true, height), scans(rail, true + error), error)
    assert not found.reason
    # The sensor has a share in it, a thousandth at most.
    assert 0.999 * TRUSTED < found.std < 3 * TRUSTED
    # A normal error is within four standard deviations but for one in 16,000.
    bound = motion.next_scan_bound(scans(rail, true), extent=EXTENT, **GROUND, **TIMES)
    assert bound < found.std
    assert abs(rest) < 4 * bound


def test_a_fast_scan_takes_ground_for_the_height_next_to_the_plane(rail, heard):
    """A cycle of height is 25 mm/s then, a third of a cell's turn: the match hardly tells it."""
    times = {"duration_s": 0.03, "interval_s": 0.03}
    echoes, antennas = heard(5.0, 0.1, times=times), scans(rail, 5.08, times)
    rest, found = left(echoes, antennas, 0.08, std=0.2, times=times)
    assert not found.reason
    # The sensor's share is (std / 0.2)^2 of its error; what is left is next to nothing.
    assert abs(rest - 0.08 * (found.std / 0.2) ** 2) < 0.025 / 8


def silent(part):
    values = part["echo"].values.copy()
    values[:, 7] = 0
    return part.assign(echo=part["echo"].copy(data=values))


REFUSED = {
    "exact": "exact",
    "one antenna": "no heights",
    "few": "12 positions are too few",
    "silent": "have no echo",
    "other ground": "clearly match",
    "out of reach": "clearly match",
    "coarse": "too coarse",
    "repeating": "ranges repeat",
}


@pytest.mark.parametrize(("case", "reason"), REFUSED.items(), ids=REFUSED)
def test_scans_that_tell_nothing_are_refused_with_the_reason(rail, heard, caplog, case, reason):
    std = {"exact": 0.0, "coarse": 60.0, "repeating": 0.9}.get(case, 0.02)
    echoes = heard(4.0, seeds=(0, 1) if case == "other ground" else (0, 0))
    antennas = scans(rail, 4.3 if case == "out of reach" else 4.0)
    if case == "few":
        echoes, antennas = (
            tuple(part.isel(position=slice(12)) for part in parts) for parts in (echoes, antennas)
        )
    elif case == "one antenna":
        echoes, antennas = (
            tuple(part.isel(channel=slice(1)) for part in parts) for parts in (echoes, antennas)
        )
    elif case == "silent":
        echoes = echoes[0], silent(echoes[1])
    with caplog.at_level(logging.WARNING):
        _, found = left(echoes, antennas, 0.0, std)
    assert reason in found.reason
    assert [found.correction, found.std] == [0, std]
    assert found.reason in caplog.records[-1].getMessage()


def test_the_cart_comes_back_while_the_vehicle_drives_on(rail):
    """Where the first scan ends the next one begins, a moment later."""
    forth, back = scans(rail, 3.0)
    for name in ("transmitter", "receiver"):
        way = (back[name] - forth[name]).values
        # At the end of the rail 0.1 s have passed, at its beginning both scans and those.
        np.testing.assert_allclose(way[:, [-1, 0], 1], [[0.3, 3.3]] * 2, atol=1e-12)
        np.testing.assert_allclose(np.diff(way[..., 1]), -3.0 / 80, atol=1e-12)
        assert not way[..., [0, 2]].any()


def test_the_interval_is_that_of_the_scan_unless_it_is_given():
    for given, interval in ((None, 0.5), (0.8, 0.8)):
        study = vinsar.load(vehicle={"scan_interval_s": given})
        assert motion.scan_interval(study.radar, study.vehicle) == interval


def test_imaging_gets_the_corrected_speed_from_the_stage(rail, heard, monkeypatch):
    study = vinsar.load(
        vehicle={
            "speed_correction": "next_scan", "speed_error_m_per_s": 0.1,
            "forward_speed_m_per_s": 4.0, "scan_interval_s": 0.6,
        }
    )  # fmt: skip
    asked = []

    def estimate(*given, **options):
        asked.append((given, options))
        return speed.Speed(-0.3, 0.01)

    monkeypatch.setattr(next_scan, "estimate", estimate)
    echoes, antennas = heard(4.0), scans(rail, 4.0)
    given = dict(zip(("received", "next_received"), echoes, strict=True))
    given |= dict(zip(("recorded_trajectory", "next_recorded_trajectory"), antennas, strict=True))
    found = pipeline.run_stage("autofocus", given, study)
    moved = trajectory.displaced(antennas[0], found["displacement"].values)
    slower = motion.advance(antennas[0], speed_m_per_s=-0.3, duration_s=0.5)
    np.testing.assert_allclose(moved["receiver"], slower["receiver"], atol=1e-12)
    (ours,) = asked
    assert ours[0][0][1].equals(echoes[1])
    assert ours[0][1][1].equals(antennas[1])
    assert ours[1] == {"extent": (-2.5, 2.5, 10.0, 16.0), "sensor_std_m_per_s": 0.1, **TIMES}


DRIVING = {"forward_speed_m_per_s": 1.0, "speed_correction": "next_scan"}
NOISY = {"snr_db": 10.0, "accuracy_db": -85.0}


def small(**echo_options):
    return vinsar.load("config/smoke.yaml", vehicle=DRIVING, echo=NOISY | echo_options)


def test_the_next_scan_hears_the_same_scene_with_noise_of_its_own():
    study = small()
    made = pipeline.run(study, "next_received")
    clean = pipeline.run_stage("next_received", made, small(snr_db=None))
    seen = pipeline.run_stage("next_received", made, small(snr_db=None, occlusion=False))
    antennas = motion.return_scan(
        trajectory.planned(study.radar), speed_m_per_s=1.0, duration_s=0.5, interval_s=0.5
    )
    frequency = waveform.sampled(study.radar)
    expected = echo.simulate(made["facets"], antennas, frequency=frequency, accuracy_db=-85.0)
    np.testing.assert_array_equal(seen["echo"], expected["echo"])
    assert np.linalg.norm(clean["echo"]) < np.linalg.norm(seen["echo"])
    own = (made["next_received"] - clean)["echo"].values.ravel()
    first = pipeline.run(study, "received")
    other = (first["received"] - first["echo"])["echo"].values.ravel()
    together = np.abs(np.vdot(own, other)) / np.linalg.norm(own) / np.linalg.norm(other)
    # The squared correlation of independent noise is exponential of mean 1 / size.
    assert together**2 < 14 / own.size
    assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(other), rel=0.2)


def test_other_studies_have_no_next_scan():
    for correction in ("none", "exact", "sensor", "echoes"):
        study = vinsar.load(vehicle={"speed_correction": correction})
        assert not [name for name in pipeline.stages(study) if name.startswith("next_")]
    assert {name for name in pipeline.stages(small()) if name.startswith("next_")} == {
        "next_true_trajectory", "next_recorded_trajectory", "next_received",
    }  # fmt: skip


def test_the_bound_of_a_standing_vehicle_is_that_of_a_turn(rail):
    """Both scans see the same directions; a wrong speed turns them apart by 2 dv T / L."""
    extent = (-0.1, 0.1, 12.0, 14.0)
    found = motion.next_scan_bound(scans(rail, 0.0), extent=extent, **GROUND, **TIMES)
    y = np.linspace(12, 14, 2001)
    cosine = y / np.hypot(y, 2)
    # An aperture of 0.8 m, 81 positions: their directions spread by 0.8 / y.
    across, along = 2 / WAVELENGTH * cosine * 0.8 / np.hypot(y, 0), cosine / 0.075
    apart = 2 * y * 0.5 / 0.8
    looks = 2 * 0.95**2 / (1 - 0.95**2)
    density = 2 * looks * across * along * (2 * np.pi * across) ** 2 / 12 * apart**2
    assert found == pytest.approx(1 / np.sqrt(density.mean() * 0.2 * 2), rel=0.01)


def test_scans_without_a_common_direction_have_no_bound(rail):
    antennas = scans(rail, 8.0)
    side = motion.next_scan_bound(antennas, extent=(2.5, 2.6, 10.0, 10.1), **GROUND, **TIMES)
    middle = motion.next_scan_bound(antennas, extent=(-0.1, 0.1, 10.0, 10.1), **GROUND, **TIMES)
    assert np.isinf(side)
    assert np.isfinite(middle)
