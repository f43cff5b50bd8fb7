"""The waveform: frequencies, resolutions and weightings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.radar import aperture, waveform
from vinsar.radar.instrument import Instrument

WINDOWS = ("rectangular", "hann", "hamming", "blackman")
LIGHT = 299_792_458.0


def test_frequencies_hold_both_ends_at_an_even_step():
    frequency = waveform.frequencies(13e9, 15e9, 401)
    assert frequency.shape == (401,)
    assert (frequency[0], frequency[-1]) == (13e9, 15e9)
    np.testing.assert_allclose(np.diff(frequency), 5e6, rtol=1e-9)


@pytest.mark.parametrize(
    ("start", "stop", "count", "message"),
    [
        (15e9, 13e9, 401, "below the stop frequency"),
        (0.0, 1e9, 401, "must be positive"),
        (13e9, 15e9, 1, "take 2 or more"),
    ],
)
def test_impossible_frequencies_are_refused(start, stop, count, message):
    with pytest.raises(ValueError, match=message):
        waveform.frequencies(start, stop, count)


def test_carrier_and_wavelength_of_the_paper():
    carrier = waveform.carrier(waveform.frequencies(13e9, 15e9, 401))
    assert carrier == 14e9
    assert waveform.wavelength(carrier) == pytest.approx(0.021413747, rel=1e-7)


def test_range_resolution_turns_the_phase_across_the_band_by_one_cycle():
    cell = waveform.range_resolution(2e9)
    assert cell == pytest.approx(0.0749, abs=1e-4)
    assert 2 * cell / LIGHT * 2e9 == pytest.approx(1)


def test_a_stepped_waveform_repeats_after_the_unambiguous_range():
    frequency = waveform.frequencies(13e9, 15e9, 401)
    period = waveform.unambiguous_range(5e6)
    turns = 2 * (frequency - frequency[0]) * period / LIGHT
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    # ... and not before: one step turns the phase by a single cycle.
    assert turns[1] == pytest.approx(1)


def monostatic(length, frequency):
    place, travel = np.array([0.0, 0.0, 2.0]), np.array([length, 0.0, 0.0])
    antenna = aperture.Aperture(place, place, travel, travel)
    return Instrument(antenna, antenna, 81, frequency)


def test_ground_resolution_straight_ahead_is_that_of_band_and_aperture():
    frequency = waveform.frequencies(13e9, 15e9, 201)
    along, ahead = monostatic(0.8, frequency).resolution(0.0, 13.0)
    slant = np.hypot(13, 2)
    assert along == pytest.approx(LIGHT / 14e9 * slant / 1.6)
    # c / 2W on the slant is longer on the ground by the cosine of the depression.
    assert ahead == pytest.approx(LIGHT / 4e9 * slant / 13)


def test_ground_resolution_off_the_axis_is_the_slope_of_ranges_and_bearings():
    # Differences of exact ranges: between the aperture's ends over x, and over y.
    frequency = waveform.frequencies(13e9, 15e9, 201)
    position, x, y = np.array([0.0, 0.0, 2.0]), 3.0, 8.0
    along, ahead = monostatic(0.8, frequency).resolution(x, y)
    ends = np.array([[-0.4, 0, 2.0], [0.4, 0, 2.0]])
    step = 1e-5

    def ranges(px, py):
        return np.linalg.norm(np.array([px, py, 0.0]) - ends, axis=1)

    def centre(px, py):
        return np.linalg.norm(np.array([px, py, 0.0]) - position)

    per_x = np.diff(ranges(x + step, y) - ranges(x - step, y))[0] / (2 * step)
    wavelength = LIGHT / 14e9
    # (L / r)^2 / 8 < 2e-3 is the aperture's curvature.
    assert along == pytest.approx(wavelength / 2 / abs(per_x), rel=2e-3)
    per_y = (centre(x, y + step) - centre(x, y - step)) / (2 * step)
    assert ahead == pytest.approx(LIGHT / 4e9 / per_y, rel=1e-6)


@given(name=st.sampled_from(WINDOWS), count=st.integers(1, 500))
def test_windows_sum_to_one_are_symmetric_and_waste_no_sample(name, count):
    weights = waveform.window(name, count)
    assert weights.shape == (count,)
    assert weights.sum() == pytest.approx(1)
    assert weights.min() > 0
    np.testing.assert_allclose(weights, weights[::-1], rtol=1e-9)


@pytest.mark.parametrize("name", WINDOWS)
def test_window_width_is_that_of_the_transform_of_a_long_window(name):
    count = 4000
    weights = waveform.window(name, count)
    place = np.arange(count) - (count - 1) / 2
    u = np.linspace(0.3, 1.2, 1801)
    power = np.abs(np.exp(-2j * np.pi * np.outer(u, place) / count) @ weights) ** 2
    half = np.interp(0.5, power[::-1], u[::-1])
    # The end samples widen or narrow a window of N samples by about 1 / N.
    assert waveform.window_width(name) == pytest.approx(2 * half, rel=2 / count)


@pytest.mark.parametrize(
    ("name", "terms"),
    [
        ("rectangular", [1.0]),
        ("hann", [0.5, 0.5]),
        ("hamming", [0.54, 0.46]),
        ("blackman", [0.42, 0.5, 0.08]),
    ],
)
def test_window_width_halves_the_power_of_the_continuous_window(name, terms):
    # The transform of a0 + 2 sum(a_k / 2 cos(2 pi k t)) on |t| < 1/2 is a sum of sincs.
    u = waveform.window_width(name) / 2
    transform = terms[0] * np.sinc(u) + sum(
        a / 2 * (np.sinc(u - k) + np.sinc(u + k)) for k, a in enumerate(terms) if k
    )
    assert (transform / terms[0]) ** 2 == pytest.approx(0.5, abs=1e-12)
