"""Errors of the baseline against Eqs. 5 and 12."""

from pathlib import Path

import numpy as np
import pytest

from vinsar.evaluation import baseline_errors
from vinsar.foundations import variables
from vinsar.radar import baseline, formulas, geometry
from vinsar.study import validation

BASELINE_M = 0.3
LENGTH_STD_M = 1e-5
ANGLE_STD_DEG = 1e-3
DRAWS = 4000
# The standard deviation of a standard deviation from so many normal draws, relative.
CHANCE = 1 / np.sqrt(2 * (DRAWS - 1))


def view(x_m=0.0, y_m=13.0, antenna_height_m=2.0):
    return baseline.View(np.array([0.0, 0.0, antenna_height_m]), x_m, y_m, 0.0214, 0.075, np.pi / 2)


def errors(seen, seed=1, baseline_m=BASELINE_M):
    return baseline_errors.angle_errors(
        seen,
        baseline_m=baseline_m,
        length_std_m=LENGTH_STD_M,
        angle_std_deg=ANGLE_STD_DEG,
        draws=DRAWS,
        rng=np.random.default_rng(seed),
    )


@pytest.fixture(scope="module")
def drawn():
    return errors(view())


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
    seen = view()
    beta = np.deg2rad(np.array([0.0, 30.0, 60.0, 85.0, 90.0]))
    eq5 = formulas.height_per_baseline_length(seen.slant_range, BASELINE_M, beta, seen.look)
    exact = baseline.height_per_length(seen, BASELINE_M, beta)
    np.testing.assert_allclose(exact - eq5, np.sin(seen.look) / np.cos(beta - seen.look))
    # A vertical baseline: Eq. 5 says H / B, the exact geometry one more.
    assert eq5[-1] == pytest.approx(2.0 / BASELINE_M)
    assert exact[-1] == pytest.approx(2.0 / BASELINE_M + 1)


def test_a_length_error_does_no_harm_below_the_look_angle():
    seen = view()
    best = seen.look - np.arcsin(BASELINE_M / seen.slant_range)
    assert float(baseline.height_per_length(seen, BASELINE_M, best)) == pytest.approx(0, abs=1e-9)
    assert np.rad2deg(best) == pytest.approx(79.95, abs=0.01)


@pytest.mark.parametrize("x", [0.0, 2.0, -4.0])
def test_the_exact_derivative_is_that_of_the_inversion(x):
    seen = view(x_m=x)
    for degrees in (10.0, 45.0, 90.0):
        beta = np.deg2rad(degrees)
        upper = seen.lower + BASELINE_M * np.array([0, np.cos(beta), np.sin(beta)])
        phase = geometry.interferometric_phase(
            seen.slant_range, geometry.slant_range(upper, seen.x_m, seen.y_m), seen.wavelength_m
        )
        shift = 1e-6 * np.array([-1, 1])
        height = geometry.invert_height(
            seen.slant_range,
            phase,
            baseline_m=BASELINE_M + shift,
            baseline_angle=beta,
            antenna_height=seen.lower[2],
            along_track=seen.x_m,
            wavelength_m=seen.wavelength_m,
        )
        slope = (height[1] - height[0]) / 2e-6
        exact = float(baseline.height_per_length(seen, BASELINE_M, beta))
        assert slope == pytest.approx(exact, rel=1e-5)


def test_the_same_seed_gives_the_same_draws_and_another_gives_others(drawn):
    assert errors(view()).identical(drawn)
    assert not errors(view(), seed=2).equals(drawn)


def test_the_view_is_that_of_the_configuration():
    study = validation.load(Path(__file__).parents[2] / "config/paper.yaml")
    seen = baseline.view(study.radar, study.scene)
    assert (seen.x_m, seen.y_m, *seen.lower) == (0.0, 13.0, 0.0, 0.0, 2.0)
    assert seen.critical_baseline == pytest.approx(12.21, abs=0.01)
