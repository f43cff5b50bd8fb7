"""Paths, and what is imaged where: on a rail against its closed form, elsewhere against paths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.radar import aperture, geometry

WAVELENGTH = 0.0214
STILL = np.zeros(3)
RAIL = np.array([0.8, 0.0, 0.0])
LOW, HIGH = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 2.3])
ASIDE = np.array([0.6, -0.3, 0.1])
TURNED = np.array([0.7, 0.4, 0.0])

PAIRS = {
    "rail": (aperture.Aperture(LOW, LOW, RAIL, RAIL), aperture.Aperture(HIGH, HIGH, RAIL, RAIL)),
    "turned rail": (
        aperture.Aperture(LOW, LOW, TURNED, TURNED),
        aperture.Aperture(HIGH, HIGH, TURNED, TURNED),
    ),
    "transmit pair": (
        aperture.Aperture(LOW, LOW, STILL, RAIL),
        aperture.Aperture(HIGH, LOW, STILL, RAIL),
    ),
    "receive pair": (
        aperture.Aperture(LOW, LOW, STILL, RAIL),
        aperture.Aperture(LOW, HIGH, STILL, RAIL),
    ),
    "transmitters aside": (
        aperture.Aperture(LOW + ASIDE, LOW, STILL, RAIL),
        aperture.Aperture(HIGH + ASIDE, LOW, STILL, RAIL),
    ),
}
every_pair = pytest.mark.parametrize("pair", PAIRS)
places = {"x": st.floats(-2.5, 2.5), "y": st.floats(4, 20), "z": st.floats(-0.5, 0.5)}


def paths(part, points, positions=3):
    """Path to each point from positions along the aperture, one by one."""
    along = np.linspace(-0.5, 0.5, positions)[:, None]
    out = part.transmitter + along * part.transmitter_travel
    back = part.receiver + along * part.receiver_travel
    return np.linalg.norm(points - out, axis=1) + np.linalg.norm(points - back, axis=1)


@pytest.mark.parametrize("travel", [RAIL, TURNED, STILL])
def test_fit_finds_the_line_of_even_positions(travel):
    along = np.linspace(-0.5, 0.5, 81)[:, None]
    found = aperture.fit(HIGH + along * STILL, LOW + along * travel)
    np.testing.assert_allclose(found.transmitter, HIGH, atol=1e-12)
    np.testing.assert_allclose(found.receiver, LOW, atol=1e-12)
    np.testing.assert_allclose(found.receiver_travel, travel, atol=1e-12)
    assert not found.transmitter_travel.any()
    assert found.uncertainty_m < 1e-12


@given(seed=st.integers(0, 1000), std=st.floats(1e-4, 0.1), axis=st.sampled_from([0, 1, 2]))
def test_random_errors_of_the_positions_turn_no_rail(seed, std, axis):
    along = np.linspace(-0.5, 0.5, 81)[:, None]
    positions = LOW + along * RAIL
    positions[:, axis] += std * np.random.default_rng(seed).standard_normal(81)
    found = aperture.fit(positions, positions)
    assert found.rail
    # The centre is known to the scatter over the root of the count, here within five of them.
    assert np.abs(found.center - LOW).max() < 5 * std / 9
    if axis == 0:
        assert found.uncertainty_m == pytest.approx(std / 9, rel=0.4)


def test_a_turn_beyond_the_errors_is_seen():
    along = np.linspace(-0.5, 0.5, 81)[:, None]
    positions = LOW + along * TURNED + 1e-3 * np.random.default_rng(0).standard_normal((81, 3))
    found = aperture.fit(positions, positions)
    # Standard error of a slope over 81 even places: 1e-3 / sqrt(81 / 12).
    np.testing.assert_allclose(found.receiver_travel, TURNED, atol=5 * 1e-3 / np.sqrt(81 / 12))
    assert not found.rail


@every_pair
@given(**places)
def test_gradients_are_the_differences_of_paths(pair, x, y, z):
    part, point, step = PAIRS[pair][1], np.array([x, y, z]), 1e-4
    path, slope = aperture.gradients(part, x, y, z)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        change = paths(part, point + shift) - paths(part, point - shift)
        assert path[axis] == pytest.approx(change[1] / (2 * step), abs=1e-7)
        # The slope at the centre differs from the ends' difference by (L / r)^2 / 8 < 5e-3.
        assert slope[axis] == pytest.approx((change[2] - change[0]) / (2 * step), abs=2e-3)


@every_pair
@given(**places)
def test_a_target_is_imaged_on_the_ground_at_its_own_path_and_slope(pair, x, y, z):
    for part in PAIRS[pair]:
        image_x, image_y = aperture.image_position(part, x, y, z)
        found = paths(part, np.array([image_x, image_y, 0.0]))
        expected = paths(part, np.array([x, y, z]))
        assert found[1] == pytest.approx(expected[1], abs=1e-9)
        # Their slopes are those at the centre. The difference between the ends departs from it by
        # the third order, (L / r)^2 / 24 of what the shift of below 0.3 m changes: 8e-4 of 2 cm.
        assert found[2] - found[0] == pytest.approx(expected[2] - expected[0], abs=5e-5)


@given(**places)
def test_around_a_rail_a_target_is_imaged_on_its_circle_at_every_position(x, y, z):
    part = PAIRS["rail"][1]
    image_x, image_y = aperture.image_position(part, x, y, z)
    assert image_x == x
    found = paths(part, np.array([image_x, image_y, 0.0]), 81)
    np.testing.assert_allclose(found, paths(part, np.array([x, y, z]), 81), atol=1e-12)


def test_image_of_the_papers_target():
    for part, shift in zip(PAIRS["rail"], (-0.11226, -0.13071), strict=True):
        x, y = aperture.image_position(part, 3.0, 5.0, 0.3)
        assert (x, y - 5.0) == pytest.approx((3.0, shift), abs=1e-5)


@every_pair
@given(**places)
def test_a_target_is_found_again_from_its_pixel_and_phase(pair, x, y, z):
    lower, upper = PAIRS[pair]
    pixel = aperture.image_position(lower, x, y, z)
    point = np.array([x, y, z])
    phase = -2 * np.pi * (paths(lower, point)[1] - paths(upper, point)[1]) / WAVELENGTH
    found = aperture.locate(lower, upper, *pixel, phase, WAVELENGTH)
    assert np.array(found) == pytest.approx(point, abs=1e-9)


def test_newtons_method_agrees_with_the_closed_form_on_a_rail(monkeypatch):
    rng = np.random.default_rng(4)
    y, x = np.meshgrid(np.linspace(5, 16, 40), np.linspace(-2.5, 2.5, 30), indexing="ij")
    # Heights up to nearly that of the antennas, and as far down.
    true_y = geometry.circle_true_y(y, rng.uniform(-1.8, 1.8, y.shape), 2.0)
    height = 2.0 - np.sqrt(y**2 + 4.0 - true_y**2)
    phase = aperture.interferometric_phase(*PAIRS["rail"], x, true_y, height, WAVELENGTH)
    closed = aperture.locate(*PAIRS["rail"], x, y, phase, WAVELENGTH)
    monkeypatch.setattr(aperture, "_above_each_other", lambda *_: False)
    monkeypatch.setattr(aperture.Aperture, "rail", False)
    general = aperture.locate(*PAIRS["rail"], x, y, phase, WAVELENGTH)
    np.testing.assert_allclose(general, closed, atol=1e-10)
    images = aperture.image_position(PAIRS["rail"][0], x, true_y, height)
    np.testing.assert_allclose(images, [x, y], atol=1e-10)


def test_a_phase_that_no_target_has_gives_nan():
    # More difference of paths than the transmitters are apart.
    for pair in ("rail", "transmit pair"):
        phase = np.array([0.0, 4.1 * np.pi * 0.3 / WAVELENGTH])
        found = aperture.locate(*PAIRS[pair], 0.0, 10.0, phase, WAVELENGTH)
        assert np.isnan(found[2]).tolist() == [False, True]


@pytest.mark.parametrize("forward", [0.0, 0.15])
def test_flat_earth_phase_is_eq_11_with_the_upper_antennas_forward_offset(forward):
    x, y = np.array([-2.0, 0.0, 1.5]), np.array([10.0, 13.0, 16.0])
    place = np.array([0.0, forward, 2.3])
    upper = aperture.Aperture(place, place, RAIL, RAIL)
    found = aperture.flat_earth_phase(PAIRS["rail"][0], upper, x, y, WAVELENGTH)
    expected = (
        -4 * np.pi / WAVELENGTH
        * (np.sqrt(2.0**2 + x**2 + y**2) - np.sqrt(2.3**2 + x**2 + (y - forward) ** 2))
    )  # fmt: skip
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_pair_of_transmitters_turns_the_phase_half_as_far():
    x, y, z = np.array([-2.0, 0.0, 1.5]), np.array([10.0, 13.0, 16.0]), 0.2
    rail, array = (
        aperture.interferometric_phase(*PAIRS[name], x, y, z, WAVELENGTH)
        for name in ("rail", "transmit pair")
    )
    np.testing.assert_allclose(rail, 2 * array, rtol=1e-12)
