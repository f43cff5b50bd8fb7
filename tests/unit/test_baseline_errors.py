"""Errors of the baseline against Eqs. 5 and 12."""

import numpy as np
import pytest

import vinsar
from vinsar.evaluation import baseline_errors
from vinsar.foundations import variables
from vinsar.radar import formulas, geometry
from vinsar.study import pipeline

BASELINE_M = 0.3
LENGTH_STD_M = 1e-5
ANGLE_STD_DEG = 1e-3
DRAWS = 4000
# The standard deviation of a standard deviation from so many normal draws, relative.
CHANCE = 1 / np.sqrt(2 * (DRAWS - 1))


ANTENNA, Y_M, WAVELENGTH_M = np.array([0.0, 0.0, 2.0]), 13.0, 0.0214
R1, LOOK = (float(f(ANTENNA, 0.0, Y_M)) for f in (geometry.slant_range, geometry.look_angle))


def errors(seed=1):
    return baseline_errors.angle_errors(
        ANTENNA,
        (0.0, Y_M),
        wavelength_m=WAVELENGTH_M,
        baseline_m=BASELINE_M,
        length_std_m=LENGTH_STD_M,
        angle_std_deg=ANGLE_STD_DEG,
        draws=DRAWS,
        rng=np.random.default_rng(seed),
    )


@pytest.fixture(scope="module")
def drawn():
    return errors()


def test_the_product_is_as_declared(drawn):
    variables.check(drawn, "baseline_angle")
    np.testing.assert_allclose(drawn["baseline_angle"], np.deg2rad(np.arange(91)))
    assert float(drawn["length_error"]) == LENGTH_STD_M
    assert float(drawn["angle_error"]) == pytest.approx(np.deg2rad(ANGLE_STD_DEG))


def test_drawn_length_errors_have_the_spread_of_the_exact_derivative(drawn):
    # Next to the zero at 79.9 deg a second order would show; with 10 micrometres it does not.
    ratio = drawn["length_drawn"] / drawn["length_exact"]
    assert np.abs(ratio - 1).max() < 4.5 * CHANCE
    assert float(((ratio - 1) ** 2).mean()) == pytest.approx(CHANCE**2, rel=0.5)


def test_drawn_attitude_errors_have_the_spread_of_eq_12_at_every_attitude(drawn):
    ratio = drawn["angle_drawn"] / drawn["angle_eq12"]
    assert np.abs(ratio - 1).max() < 4.5 * CHANCE
    # Ahead of the vehicle r1 sin(theta) is the distance on the ground.
    np.testing.assert_allclose(drawn["angle_eq12"], 13.0 * np.deg2rad(ANGLE_STD_DEG))


def test_eq_5_lacks_one_term_of_the_exact_derivative():
    beta = np.deg2rad(np.array([0.0, 30.0, 60.0, 85.0, 90.0]))
    eq5 = formulas.height_per_baseline_length(R1, BASELINE_M, beta, LOOK)
    exact = baseline_errors.height_per_length(ANTENNA, Y_M, BASELINE_M, beta)
    np.testing.assert_allclose(exact - eq5, np.sin(LOOK) / np.cos(beta - LOOK))
    # A vertical baseline: Eq. 5 says H / B, the exact geometry one more.
    assert eq5[-1] == pytest.approx(2.0 / BASELINE_M)
    assert exact[-1] == pytest.approx(2.0 / BASELINE_M + 1)


def test_a_length_error_does_no_harm_below_the_look_angle():
    best = LOOK - np.arcsin(BASELINE_M / R1)
    assert float(
        baseline_errors.height_per_length(ANTENNA, Y_M, BASELINE_M, best)
    ) == pytest.approx(0, abs=1e-9)
    assert np.rad2deg(best) == pytest.approx(79.95, abs=0.01)


@pytest.mark.parametrize("x", [0.0, 2.0, -4.0])
def test_the_exact_derivative_is_that_of_the_inversion(x):
    r1 = geometry.slant_range(ANTENNA, x, Y_M)
    for degrees in (10.0, 45.0, 90.0):
        beta = np.deg2rad(degrees)
        upper = ANTENNA + BASELINE_M * np.array([0, np.cos(beta), np.sin(beta)])
        phase = geometry.interferometric_phase(
            r1, geometry.slant_range(upper, x, Y_M), WAVELENGTH_M
        )
        shift = 1e-6 * np.array([-1, 1])
        height = geometry.invert_height(
            r1,
            phase,
            baseline_m=BASELINE_M + shift,
            baseline_angle=beta,
            antenna_height=ANTENNA[2],
            along_track=x,
            wavelength_m=WAVELENGTH_M,
        )
        slope = (height[1] - height[0]) / 2e-6
        exact = float(baseline_errors.height_per_length(ANTENNA, Y_M, BASELINE_M, beta))
        assert slope == pytest.approx(exact, rel=1e-5)


def test_the_same_seed_gives_the_same_draws_and_another_gives_others(drawn):
    assert errors().identical(drawn)
    assert not errors(seed=2).equals(drawn)


@pytest.mark.parametrize(
    ("system", "height"), [("rail", 2.0), ("transmit_pair", 2.1), ("receive_pair", 2.0)]
)
def test_the_stage_takes_the_antennas_that_the_baseline_separates(system, height):
    study = vinsar.load()
    radar = study.radar.model_copy(update={"system": system, "transmitter_height_m": 2.1})
    found = pipeline.run_stage("baseline_angle", {}, study.model_copy(update={"radar": radar}))
    antenna = np.array([0.0, 0.0, height])
    if system == "transmit_pair":
        antenna[:2] = radar.transmitter_x_m, radar.transmitter_y_m
    exact = baseline_errors.height_per_length(antenna, 13.0, 0.3, np.deg2rad(90.0))
    expected = study.baseline_errors.length_std_m * float(exact)
    assert float(found["length_exact"][-1]) == pytest.approx(expected)
    # The drawn ones invert the phase of this wavelength: another would not fit.
    ratio = float(found["length_drawn"][-1]) / expected
    assert ratio == pytest.approx(1, abs=4.5 / np.sqrt(2 * study.baseline_errors.draws))
