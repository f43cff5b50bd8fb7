"""Radars' own forms: of point targets each gives the echo of a stepped frequency.

The truth is the sum over targets of a exp(-2 pi i f T) at the frequencies that come out, with T
the delay along the path.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations.constants import SPEED_OF_LIGHT as C
from vinsar.readers import forms

RANGES = np.array([3.0, 4.4, 7.1])
AMPLITUDES = np.array([1.0, 0.7j, -0.5])
# Positions of a radar that moves: all ranges grow by 2 cm from one to the next.
DELAYS = 2 * (RANGES + 0.02 * np.arange(5)[:, None]) / C


def stepped(frequency, delays=DELAYS):
    turns = frequency * delays[..., None]
    return (AMPLITUDES[:, None] * np.exp(-2j * np.pi * turns)).sum(axis=-2)


def beat(frequency, rate, delays=DELAYS):
    """Return the transmitted signal mixed with the conjugate of the received one."""
    phase = 2 * np.pi * frequency * delays[..., None] - np.pi * rate * delays[..., None] ** 2
    return (AMPLITUDES.conj()[:, None] * np.exp(1j * phase)).sum(axis=-2)


def profile(echo, frequency):
    """Return windowed range profiles at the targets, where edges and other targets are far."""
    window = np.hanning(frequency.size + 2)[1:-1]
    turn = np.exp(2j * np.pi * frequency * DELAYS[..., None])
    return (window * echo[:, None] * turn).sum(axis=-1) / window.sum()


# Stepped


def test_frequencies_that_fall_are_turned_round():
    frequency = np.linspace(9e9, 8e9, 101)
    found = forms.stepped(stepped(frequency), frequency)
    np.testing.assert_array_equal(found.frequency, frequency[::-1])
    np.testing.assert_allclose(found.samples, stepped(found.frequency), atol=1e-12)


def test_the_other_sign_is_conjugated():
    frequency = np.linspace(8e9, 9e9, 101)
    found = forms.stepped(stepped(frequency).conj(), frequency, sign=1)
    np.testing.assert_allclose(found.samples, stepped(frequency), atol=1e-12)


@given(reference=st.lists(st.floats(0, 20_000), min_size=5, max_size=5))
def test_a_reference_range_is_put_back(reference):
    frequency = np.linspace(9e9, 9.6e9, 61)
    taken = np.array(reference)
    compensated = stepped(frequency) * np.exp(4j * np.pi * frequency * taken[:, None] / C)
    found = forms.stepped(compensated, frequency, reference_range_m=taken)
    # Phases of 20 km at 9.6 GHz: 8e6 rad, of which double precision keeps 1e-9.
    np.testing.assert_allclose(found.samples, stepped(frequency), atol=1e-7)


def test_real_samples_over_frequency_are_refused():
    with pytest.raises(ValueError, match="must be complex"):
        forms.stepped(np.ones((3, 4)), np.linspace(1e9, 2e9, 4))


@pytest.mark.parametrize("frequency", [[1e9, 1.1e9, 1.3e9], [1e9, 1e9, 1e9], [1e9, np.nan, 3e9]])
def test_uneven_frequencies_are_refused(frequency):
    with pytest.raises(ValueError, match="even steps"):
        forms.stepped(np.ones((3, 3), complex), frequency)


# Dechirped


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("rate", [1.5e10, -1.5e10])
def test_a_complex_beat_is_the_echo(rate, sign):
    sample_rate, count = 2e4, 400
    time = np.arange(count) / sample_rate
    start = 2.3e9 if rate > 0 else 2.6e9
    swept = start + rate * time
    samples = beat(swept, rate)
    found = forms.dechirped(
        samples if sign > 0 else samples.conj(),
        start_frequency_hz=start,
        sweep_rate_hz_per_s=rate,
        sample_rate_hz=sample_rate,
        sign=sign,
    )
    np.testing.assert_allclose(found.frequency, np.sort(swept), rtol=1e-12)
    # The residual video phase is 1e-4 rad here; the filter's edges, half a percent, are windowed.
    np.testing.assert_allclose(
        profile(found.samples, found.frequency),
        profile(stepped(found.frequency), found.frequency),
        atol=1e-3,
    )


@pytest.mark.parametrize("rate", [1.5e10, -1.5e10])
def test_of_a_real_beat_the_positive_ranges_are_taken(rate):
    sample_rate, count = 2e4, 400
    time = np.arange(count) / sample_rate
    start = 2.3e9 if rate > 0 else 2.6e9
    samples = beat(start + rate * time, rate).real
    found = forms.dechirped(
        samples, start_frequency_hz=start, sweep_rate_hz_per_s=rate, sample_rate_hz=sample_rate
    )
    # The mirrored targets lie 12 cells and more away: sidelobes of the Hann window below 1e-4, and
    # of the analytic signal's edges below 1e-2.
    np.testing.assert_allclose(
        profile(found.samples, found.frequency),
        profile(stepped(found.frequency), found.frequency),
        atol=1e-2,
    )


def test_the_residual_video_phase_is_removed():
    rate, sample_rate, count = 2e15, 1.2e9, 2400
    time = np.arange(count) / sample_rate
    swept = 8e9 + rate * time
    found = forms.dechirped(
        beat(swept, rate),
        start_frequency_hz=8e9,
        sweep_rate_hz_per_s=rate,
        sample_rate_hz=sample_rate,
    )
    # At the farthest target it is pi a T^2 = 14 rad, and the filter moves its beat by 2 % of the
    # sweep, whose empty end the window does not reach to more than 1e-3.
    residual = np.pi * rate * DELAYS.max() ** 2
    assert residual > 10
    np.testing.assert_allclose(
        profile(found.samples, found.frequency),
        profile(stepped(found.frequency), found.frequency),
        atol=5e-3,
    )


def test_sweeps_to_and_fro_share_their_frequencies():
    rate, sample_rate, count = 1.5e10, 2e4, 300
    step = rate / sample_rate
    out, back = 2.3e9 + step * np.arange(count), 2.3e9 + step * (count - np.arange(count))
    samples = np.where(np.arange(5)[:, None] % 2 == 0, beat(out, rate), beat(back, -rate))
    found = forms.dechirped(
        samples,
        start_frequency_hz=2.3e9,
        sweep_rate_hz_per_s=rate,
        sample_rate_hz=sample_rate,
        alternating=True,
    )
    assert found.frequency.size == count - 1
    np.testing.assert_allclose(
        profile(found.samples, found.frequency),
        profile(stepped(found.frequency), found.frequency),
        atol=1e-3,
    )


@pytest.mark.parametrize(("rate", "sample_rate"), [(0.0, 1e4), (1e10, 0.0), (-1e15, 1e6)])
def test_a_sweep_that_is_none_is_refused(rate, sample_rate):
    with pytest.raises(ValueError, match="sweep"):
        forms.dechirped(
            np.ones((2, 50)),
            start_frequency_hz=2e9,
            sweep_rate_hz_per_s=rate,
            sample_rate_hz=sample_rate,
        )


# Pulses

CARRIER, SPREAD = 4e9, 3e8


def pulse(time, carrier=CARRIER):
    """Return a Gaussian pulse, whose spectrum is `shape`."""
    return np.exp(-2 * (np.pi * SPREAD * time) ** 2 + 2j * np.pi * carrier * time)


def shape(frequency):
    """Return the pulse's transform, but for a factor."""
    return np.exp(-((frequency - CARRIER) ** 2) / (2 * SPREAD**2))


def assert_is_echo(found, factor):
    expected = factor * shape(found.frequency) * stepped(found.frequency)
    # Of the pulse 1e-8 lies outside the samples.
    np.testing.assert_allclose(found.samples, expected, atol=1e-6 * factor)


def weight(step_m):
    """Return what the transform's samples sum to: the pulse's integral over the sampling step."""
    return np.sqrt(1 / (2 * np.pi)) / SPREAD / (2 * step_m / C)


def test_the_spectrum_of_real_pulses_is_the_echo():
    ranges = 1.0 + 0.009 * np.arange(1100)
    time = 2 * ranges / C
    sent = (AMPLITUDES[:, None] * pulse(time - DELAYS[..., None])).sum(axis=-2)
    found = forms.pulses(sent.real, ranges)
    assert found.frequency[0] > 3e9
    # 10 dB down a Gaussian is 1.52 spreads from its middle.
    assert np.ptp(found.frequency) == pytest.approx(2 * 1.517 * SPREAD, rel=0.25)
    assert_is_echo(found, weight(0.009))


def test_complex_pulses_have_a_carrier():
    ranges = 1.0 + 0.05 * np.arange(200)
    time = 2 * ranges / C
    sent = (AMPLITUDES[:, None] * pulse(time - DELAYS[..., None])).sum(axis=-2)
    mixed = sent * np.exp(-2j * np.pi * CARRIER * time)
    band = (3.7e9, 4.3e9)
    found = forms.pulses(mixed, ranges, carrier_frequency_hz=CARRIER, band_hz=band)
    assert_is_echo(found, weight(0.05))
    turned = forms.pulses(mixed.conj(), ranges, carrier_frequency_hz=CARRIER, band_hz=band, sign=1)
    # Conjugated samples have their spectrum mirrored about the carrier; taken back, it is right.
    assert_is_echo(turned, weight(0.05))


@pytest.mark.parametrize("kept", [False, True])
def test_compressed_profiles_have_a_reference_range(kept):
    reference = np.array([1000.0, 1000.1, 1000.3, 1000.6, 1001.0])
    ranges = -1.0 + 0.05 * np.arange(240)
    time = 2 * ranges / C
    sent = (AMPLITUDES[:, None] * pulse(time - DELAYS[..., None])).sum(axis=-2)
    mixed = sent * np.exp(-2j * np.pi * CARRIER * time)
    if kept:
        # Moved in range alone: the carrier has its whole path.
        mixed *= np.exp(-4j * np.pi * CARRIER * reference[:, None] / C)
    found = forms.pulses(
        mixed, ranges, carrier_frequency_hz=CARRIER, band_hz=(3.7e9, 4.3e9),
        reference_range_m=reference, carrier_kept=kept,
    )  # fmt: skip
    delays = DELAYS + 2 * reference[:, None] / C
    expected = weight(0.05) * shape(found.frequency) * stepped(found.frequency, delays)
    np.testing.assert_allclose(found.samples, expected, atol=1e-5 * weight(0.05))


@pytest.mark.parametrize(
    ("samples", "ranges", "options", "word"),
    [
        (np.ones((3, 4)), [1.0, 2.0, 3.0], {}, "do not fit 3 ranges"),
        (np.ones((3, 4)), [4.0, 3.0, 2.0, 1.0], {}, "ranges fall"),
        (np.ones((3, 4)), [1.0, 2.0, 3.0, 4.0], {"carrier_frequency_hz": 1e9}, "no carrier"),
        (np.ones((3, 4)), [1.0, 2.0, 3.0, 4.0], {"band_hz": (5e9, 6e9)}, "the band has 0"),
        (np.ones((3, 4), complex), [1.0, 2.0, 3.0, 4.0], {}, "the band"),
    ],
)
def test_pulses_that_will_not_do_are_refused(samples, ranges, options, word):
    with pytest.raises(ValueError, match=word):
        forms.pulses(samples, ranges, **options)
