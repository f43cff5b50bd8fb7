"""Surveyed reflectors: a point target comes out where it is, as wide as theory has it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from vinsar.evaluation import reflectors
from vinsar.foundations.constants import SPEED_OF_LIGHT as C
from vinsar.processing import focusing
from vinsar.radar import trajectory

FREQUENCY = np.linspace(9e9, 10e9, 101)
PLACES = np.array([[0.3, 6.0, 0.0], [-0.8, 7.0, 0.4]])


@pytest.fixture(scope="module", params=["rectangular", "hann"])
def found(request):
    antennas = trajectory.rail(
        aperture_length_m=1.0, position_spacing_m=0.01, rail_height_m=2.0, baseline_m=0.2,
        baseline_angle_deg=90.0,
    )  # fmt: skip
    ends = antennas["transmitter"].values[..., None, :]
    ranges = np.linalg.norm(ends - PLACES, axis=-1)[..., None]
    echo = np.exp(-4j * np.pi * FREQUENCY * ranges / C).sum(axis=-2)
    profiles = focusing.compress(
        xr.Dataset(
            {"echo": (("channel", "position", "frequency"), echo)},
            {"channel": antennas["channel"], "frequency": FREQUENCY},
        ),
        near_range_m=4.5, far_range_m=9.0, window=request.param, interpolation="cubic",
    )  # fmt: skip
    surveyed = PLACES + np.array([0.02, -0.03, 0.0])
    return request.param, reflectors.measure(
        profiles, antennas, surveyed, frequency=FREQUENCY,
        range_window=request.param, aperture_window=request.param,
    )  # fmt: skip


def test_targets_are_where_they_are(found):
    _, product = found
    # Half a pixel, an eighth of cells of 10 x 16 cm, and what the other target's sidelobes shift.
    np.testing.assert_allclose(product["imaged"][0], PLACES[:, :2], atol=0.015)
    np.testing.assert_allclose(product["imaged"][1], PLACES[:, :2], atol=0.015)


def test_they_are_as_wide_as_theory_has_them(found):
    _, product = found
    expected = product["expected_width"].values
    # c / 2W r / y and lambda r / 2L of the first, but for the window.
    r = np.hypot(np.hypot(0.3, 6.0), 2.0)
    ratio = expected[0, 0] / expected[0, 1]
    assert ratio == pytest.approx((C / 9.5e9 * r / 2) / (C / 2e9 * r / 6.0), rel=0.02)
    # The cut is not quite along the sidelobes' ridge, and the other target adds sidelobes.
    np.testing.assert_allclose(product["width"][0], expected, rtol=0.08)


def test_sidelobes_are_those_of_the_window(found):
    window, product = found
    highest = 10 * np.log10(product["sidelobe"].values[0, 0])
    # Of a sinc -13.3 dB, of Hann's -31.5 dB; the other target lies 10 cells away.
    assert highest == pytest.approx(-13.3 if window == "rectangular" else -31.5, abs=2.5)


def test_a_width_beyond_the_patch_is_unknown():
    axis = np.linspace(0, 1, 11)
    assert np.isnan(reflectors._width(np.ones(11), axis, 5))
