"""Point targets imaged from a moving vehicle: focus, place, displacement and height."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vinsar
from vinsar.evaluation import misregistration
from vinsar.processing import focusing, speed
from vinsar.radar import aperture, motion, trajectory, waveform
from vinsar.simulation import echo

PAPER = Path(__file__).parents[2] / "config/paper.yaml"
LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = LIGHT / 14e9
# A cart at 1.6 m/s on the way and a switched array at 80 m/s.
SCANS = {"rail": 0.5, "array": 0.01}


@pytest.fixture(scope="module")
def moving(rail):
    def make(speed, scan):
        return motion.advance(rail, speed_m_per_s=speed, duration_s=SCANS[scan])

    return make


@pytest.fixture(scope="module")
def image(scatterers):
    """Image a unit point target from where the antennas were as if they had been elsewhere."""

    def make(target, truth, recorded, x, y):
        near, far = trajectory.range_extent(recorded, x, y)
        profiles = focusing.compress(
            echo.simulate(scatterers(target), truth, frequency=FREQUENCY, accuracy_db=None),
            near_range_m=max(near - 1, 0),
            far_range_m=far + 1,
        )
        return focusing.backproject(profiles, recorded, x=x, y=y)["image"].values

    return make


def width(axis, values):
    """-3 dB width of a cut through a peak in its middle, by linear interpolation."""
    power = np.abs(values) ** 2 / np.abs(values[axis.size // 2]) ** 2
    half = axis.size // 2
    right = np.interp(-0.5, -power[half:], axis[half:])
    left = np.interp(0.5, power[: half + 1], axis[: half + 1])
    return right - left


@pytest.mark.parametrize(("speed", "scan"), [(2.0, "rail"), (5.0, "rail"), (10.0, "array")])
def test_the_true_speed_focuses_a_point_at_its_place(moving, image, speed, scan):
    antennas = moving(speed, scan)
    slant = np.hypot(13.0, 2.0)
    fine = np.linspace(-1, 1, 201)
    # Ahead of the aperture's centre the direction to the target turns by the way along x alone:
    # the widths are those at rest, of 81 steps of 1 cm and 201 of 10 MHz.
    azimuth, cell = WAVELENGTH * slant / (2 * 0.81), LIGHT / (2 * 201 * 10e6)
    target = (0.0, 13.0, 0.0)
    along = image(target, antennas, antennas, 2 * azimuth * fine, np.array([13.0]))[0, 0]
    ahead_y = np.sqrt((slant + 2 * cell * fine) ** 2 - 4)
    ahead = image(target, antennas, antennas, np.array([0.0]), ahead_y)[0, :, 0]
    for cut in (along, ahead):
        assert np.abs(cut).argmax() == 100
        # The images of linear interpolation at 16 times, as at rest.
        assert np.abs(cut[100] - 1) < 1.2e-3
    factor = waveform.window_width("rectangular")
    assert width(2 * azimuth * fine, along) == pytest.approx(factor * azimuth, rel=0.03)
    assert width(2 * cell * fine, ahead) == pytest.approx(factor * cell, rel=0.03)


@pytest.mark.parametrize(
    ("speed", "told", "scan"),
    [(10.0, 0.0, "array"), (0.0, 3.0, "array"), (5.0, 5.02, "rail"), (2.0, 1.95, "rail")],
)
@pytest.mark.parametrize("target", [(0.0, 13.0, 0.0), (1.5, 11.0, 0.0)])
def test_a_wrong_speed_displaces_as_predicted(moving, image, speed, told, scan, target):
    truth, recorded = moving(speed, scan), moving(told, scan)
    slopes = [motion.slope(v, aperture_length_m=0.8, duration_s=SCANS[scan]) for v in (speed, told)]
    expected = np.array(
        motion.imaged_place(*target[:2], true_slope=slopes[0], told_slope=slopes[1])
    )
    assert np.hypot(*(expected - target[:2])) > 0.15

    def imager(_):
        return lambda x, y: image(target, truth, recorded, x, y)

    shift = misregistration.measure_shift(
        imager, np.array([*expected, 0.0]), np.array([0.17, 0.075])
    )
    # Of the squared way |k^2 - k'^2| s^2 / 2r remains, a mean and, as r changes over the aperture,
    # a cubic (test_motion.py); near the axis a range ramp moves x by 1 / (1 - k x / y) as much.
    x, y, _ = target
    rest = abs(slopes[0] ** 2 - slopes[1] ** 2) * 0.4**2 / (2 * np.hypot(y, 2.0))
    rest *= (1 / 3 + 3 / 5 * (x + slopes[0] * y) / y) / (1 - slopes[1] * x / y)
    # Interpolation ripples by 0.2 mm.
    assert np.abs(shift).max() < 2 * rest + 0.2e-3


@pytest.mark.parametrize(("speed", "scan"), [(2.0, "rail"), (5.0, "rail"), (10.0, "array")])
@pytest.mark.parametrize("target", [(0.0, 13.0, 0.3), (-2.0, 11.0, -0.2), (1.5, 15.0, 0.25)])
def test_the_height_of_a_raised_target_is_inverted_from_its_image(
    moving, image, speed, scan, target
):
    antennas = moving(speed, scan)
    lower, upper = trajectory.apertures(antennas)
    # The circle about the turned axis: place along it, and distance from it, of the target.
    yaw = np.arctan2(speed * SCANS[scan], 0.8)
    axis, across = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    along, away = axis @ target[:2], across @ target[:2]
    x, y = along * axis + np.sqrt(away**2 + (2.0 - target[2]) ** 2 - 4.0) * across
    found = image(target, antennas, antennas, np.array([x, x + 1]), np.array([y, y + 1]))[:, 0, 0]
    assert np.abs(found[0]) == pytest.approx(1, abs=1.2e-3)
    # The upper image of the target lies elsewhere by less than a tenth of a cell.
    assert np.abs(found[1]) > 0.95
    wrapped = np.angle(found[0] * np.conj(found[1]))
    flat = aperture.flat_earth_phase(lower, upper, x, y, WAVELENGTH)
    true = aperture.interferometric_phase(lower, upper, *target, WAVELENGTH)
    cycles = np.round((true - flat - wrapped) / (2 * np.pi))
    place = aperture.locate(lower, upper, x, y, wrapped + flat + 2 * np.pi * cycles, WAVELENGTH)
    # A hundredth of a cycle of phase, of 0.47 m a cycle.
    np.testing.assert_allclose(np.array(place), target, atol=5e-3)


@pytest.mark.parametrize("system", ["transmit_pair", "receive_pair"])
@pytest.mark.parametrize("target", [(0.0, 13.0, 0.3), (-2.0, 11.0, -0.2)])
def test_a_switched_array_on_a_moving_vehicle_inverts_the_height(image, system, target):
    paper = vinsar.load().radar
    antennas = motion.advance(
        trajectory.planned(paper.model_copy(update={"system": system})),
        speed_m_per_s=10.0,
        duration_s=0.03,
    )
    lower, upper = trajectory.apertures(antennas)
    x, y = (float(value) for value in aperture.image_position(lower, *target))
    found = image(target, antennas, antennas, np.array([x, x + 1]), np.array([y, y + 1]))[:, 0, 0]
    assert np.abs(found[0]) == pytest.approx(1, abs=1.2e-3)
    # The upper image of the target lies elsewhere by less than a tenth of a cell.
    assert np.abs(found[1]) > 0.99
    wrapped = np.angle(found[0] * np.conj(found[1]))
    flat = aperture.flat_earth_phase(lower, upper, x, y, WAVELENGTH)
    true = aperture.interferometric_phase(lower, upper, *target, WAVELENGTH)
    cycles = np.round((true - flat - wrapped) / (2 * np.pi))
    place = aperture.locate(lower, upper, x, y, wrapped + flat + 2 * np.pi * cycles, WAVELENGTH)
    # A hundredth of a cycle of phase, of 0.93 m a cycle.
    np.testing.assert_allclose(np.array(place), target, atol=1e-2)


GROUND = (-2.0, 2.0, 10.0, 13.5)


def bound(antennas, incoherent=0.05):
    return motion.speed_bound(
        antennas, extent=GROUND, wavelength_m=WAVELENGTH, range_cell_m=0.075,
        incoherent=incoherent, duration_s=0.5,
    )  # fmt: skip


@pytest.mark.parametrize(("error", "seed", "snr_db"), [(0.06, 1, None), (-0.08, 2, 10.0)])
def test_echoes_tell_the_speed(moving, scatterers, error, seed, snr_db):
    rng = np.random.default_rng(seed)
    places = np.zeros((8_000, 3))
    places[:, 0] = rng.uniform(*GROUND[:2], len(places))
    places[:, 1] = rng.uniform(*GROUND[2:], len(places))
    true = moving(4.0, "rail")
    received = echo.simulate(scatterers(places), true, frequency=FREQUENCY, accuracy_db=-60.0)
    if snr_db is not None:
        received = echo.add_noise(received, snr_db=snr_db, swath_m=3.5, rngs=[rng, rng])
    found = speed.estimate(
        received, moving(4.0 + error, "rail"), extent=GROUND, duration_s=0.5,
        sensor_std_m_per_s=0.05,
    )  # fmt: skip
    assert not found.reason
    # Three standard deviations of an estimate that errs 2.5 times as much as the bound says.
    left = error + found.correction
    assert abs(left) < 7.5 * bound(true, 0.05 if snr_db is None else 1 / 11) < abs(error)
    assert abs(left) < 5 * found.std < 0.25


def test_the_bound_is_that_of_the_quadratic_phase(moving, rail):
    """At a small yaw angle: one parameter of the phases of normal speckle, J = 2 N (R o R^-T - 1).

    Sum over ranges of q^T J q, by the phase q = 2 pi (k + dk)^2 s^2 / (lambda r) for a slope dk.
    """
    speed_m_per_s, incoherent = 0.4, 0.05
    k = float(motion.slope(speed_m_per_s, aperture_length_m=0.8, duration_s=0.5))
    s = np.linspace(-0.4, 0.4, 81)
    total, ranges = 0.0, np.hypot(np.linspace(10.0, 13.5, 30), 2.15)
    for r in ranges:
        ground = np.sqrt(r**2 - 2.15**2)
        x = np.linspace(-2, 2, 300)
        cosine = (x + k * np.sqrt(ground**2 - x**2)) / r
        steering = np.exp(4j * np.pi / WAVELENGTH * np.outer(s, cosine))
        cov = (1 - incoherent) * steering @ steering.conj().T / x.size + incoherent * np.eye(81)
        information = 2 * ((cov * np.linalg.inv(cov).T).real - np.eye(81))
        q = 4 * np.pi * k * s**2 / (WAVELENGTH * r)
        total += q @ information @ q / ranges.size
    cells = 2 * (ranges[-1] - ranges[0]) / 0.075
    expected = 0.8 / 0.5 / np.sqrt(total * cells)
    # Far ground is ahead, not around; the exact path has higher orders: a few per cent.
    assert bound(moving(speed_m_per_s, "rail"), incoherent) == pytest.approx(expected, rel=0.05)
    # The phase grows with the square of the slope: twice the speed tells a small error twice as
    # well, and a vehicle that stands tells nothing.
    faster = bound(moving(2 * speed_m_per_s, "rail"), incoherent)
    assert faster == pytest.approx(expected / 2, rel=0.05)
    assert bound(rail) > 1e6
