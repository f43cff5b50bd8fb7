"""Calibration of simulated echoes: what was put in comes out, within what noise leaves."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations.constants import SPEED_OF_LIGHT as C
from vinsar.processing import calibration

FREQUENCY = np.linspace(3.1e9, 4.8e9, 120)
REFLECTOR = np.array([0.6, 4.2, 0.1])
TIME = np.linspace(0, 10, 200)


def path(time):
    """Return where a cart is that is pushed unevenly along a rail."""
    x = 0.3 * (time - 5) + 0.05 * np.sin(time)
    return np.stack([x, 0.01 * np.sin(2 * time), 1.8 + 0.002 * np.cos(time)], axis=-1)


def above(channel):
    return np.array([0, 0, 0.2 * channel])


def echoes(
    *, bias=0.0, offset=0.0, delay=0.0, phase=0.0, channels=1, noise=0.0, seed=1, targets=None
):
    """Return echoes whose ranges are too long, whose clock is early and whose channels differ."""
    places = np.stack([path(TIME) + above(channel) for channel in range(channels)])
    true = np.stack([path(TIME + offset) + above(channel) for channel in range(channels)])
    samples = np.zeros((channels, TIME.size, FREQUENCY.size), complex)
    for place, amplitude in targets or [(REFLECTOR, 1.0)]:
        ranges = np.linalg.norm(true - place, axis=-1)[..., None] + bias
        samples += amplitude * np.exp(-4j * np.pi * FREQUENCY * ranges / C)
    carrier = (FREQUENCY[0] + FREQUENCY[-1]) / 2
    if channels > 1:
        samples[1] *= np.exp(-2j * np.pi * (FREQUENCY - carrier) * delay + 1j * phase)
    rng = np.random.default_rng(seed)
    samples += noise * (rng.normal(size=samples.shape) + 1j * rng.normal(size=samples.shape))
    return calibration.Echoes(samples, FREQUENCY, places, places, TIME)


def thinned(data):
    """Return every fourth position and third frequency, which is enough for one target."""
    ends = data.transmitter[:, ::4], data.receiver[:, ::4]
    return calibration.Echoes(data.samples[:, ::4, ::3], FREQUENCY[::3], *ends, TIME[::4])


@pytest.mark.parametrize(("bias", "offset"), [(0.42, 0.05), (-0.3, -0.08), (0.0, 0.0)])
def test_a_reflector_gives_bias_and_offset(bias, offset):
    found = calibration.from_reflector(echoes(bias=bias, offset=offset), REFLECTOR)
    # What the paraboloid leaves without noise: a hundredth of a step of the coarse grid.
    assert found.range_bias_m.value == pytest.approx(bias, abs=2e-4)
    assert found.time_offset_s[0].value == pytest.approx(offset, abs=1e-3)
    assert found.channel_delay_s is None


def test_a_second_channel_gives_delay_and_phase():
    data = echoes(bias=0.1, delay=0.2e-9, phase=1.1, channels=2)
    found = calibration.from_reflector(data, REFLECTOR)
    assert found.channel_delay_s[0].value == 0
    assert found.channel_delay_s[1].value == pytest.approx(0.2e-9, abs=2e-12)
    assert found.channel_phase_rad[1].value == pytest.approx(1.1, abs=0.01)


def test_the_deviation_is_that_of_many_draws():
    truth, draws = 0.2, 24
    found = [
        calibration.from_reflector(
            thinned(echoes(bias=truth, noise=0.5, seed=seed)), REFLECTOR, largest_offset_s=0.1
        )
        for seed in range(draws)
    ]
    errors = np.array([one.range_bias_m.value - truth for one in found])
    stated = np.sqrt(np.mean([one.range_bias_m.std**2 for one in found]))
    # The spread of 24 normal draws is known to 1 / sqrt(2 x 23) = 15 %, and the mean of as many
    # jackknives over 10 blocks, of 9 degrees of freedom each, to 5 %: 3 of both together.
    assert errors.std(ddof=1) == pytest.approx(stated, rel=0.47)
    assert abs(errors.mean()) < 4 * stated / np.sqrt(draws)


def test_half_of_the_positions_predict_the_other():
    data = echoes(bias=0.42, offset=0.03, noise=0.5)
    even = np.arange(TIME.size) % 2 == 0
    one = calibration.from_reflector(data, REFLECTOR, use=even)
    other = calibration.from_reflector(data, REFLECTOR, use=~even)
    for first, second in (
        (one.range_bias_m, other.range_bias_m),
        (one.time_offset_s[0], other.time_offset_s[0]),
    ):
        assert abs(first.value - second.value) < 4 * np.hypot(first.std, second.std)


def test_what_is_applied_is_gone():
    data = echoes(bias=0.42, offset=0.05, delay=0.1e-9, phase=-0.7, channels=2)
    found = calibration.from_reflector(data, REFLECTOR)
    clean = calibration.apply(data, found)
    again = calibration.from_reflector(clean, REFLECTOR)
    assert again.range_bias_m.value == pytest.approx(0, abs=3e-4)
    assert again.time_offset_s[0].value == pytest.approx(0, abs=1e-3)
    assert again.channel_phase_rad[1].value == pytest.approx(0, abs=0.01)
    # The antennas are where they were, at the times that have positions.
    np.testing.assert_allclose(clean.transmitter[0], path(clean.time + 0.05), atol=1e-4)
    assert clean.samples.shape[1] == clean.time.size < TIME.size


def test_only_what_is_chosen_is_applied():
    data = echoes(bias=0.42, offset=0.05)
    found = calibration.from_reflector(data, REFLECTOR)
    np.testing.assert_array_equal(calibration.apply(data, found, ()).samples, data.samples)
    assert calibration.apply(data, found, ("range",)).transmitter is data.transmitter
    with pytest.raises(ValueError, match="nothing called tilt"):
        calibration.apply(data, found, ("tilt",))


def test_without_times_there_is_no_offset():
    data = echoes(bias=0.3)
    found = calibration.from_reflector(
        calibration.Echoes(data.samples, FREQUENCY, data.transmitter, data.receiver), REFLECTOR
    )
    assert found.range_bias_m.value == pytest.approx(0.3, abs=2e-4)
    assert found.time_offset_s is None


def test_a_reflector_that_is_not_there_is_not_found():
    with pytest.raises(ValueError, match="was not found"):
        calibration.from_reflector(echoes(bias=0.42), REFLECTOR, largest_bias_m=0.3)


def test_level_ground_gives_delay_and_phase():
    rng = np.random.default_rng(3)
    targets = [
        (np.array([x, y, 0.0]), np.exp(2j * np.pi * turn))
        for x, y, turn in zip(
            rng.uniform(-1, 1, 150), rng.uniform(4, 6, 150), rng.uniform(size=150), strict=True
        )
    ]
    data = echoes(delay=0.15e-9, phase=0.9, channels=2, targets=targets)
    found = calibration.from_ground(data, [(-0.8, 0.8, 4.3, 5.7)])
    for estimates, truth in (
        (found.channel_delay_s, 0.15e-9),
        (found.channel_phase_rad, 0.9),
    ):
        assert abs(estimates[1].value - truth) < 4 * estimates[1].std
    # The baseline leaves little of the phase's spread: a few degrees over the region.
    assert found.channel_phase_rad[1].std < 0.1
    assert found.range_bias_m is None


def test_level_ground_needs_two_channels():
    with pytest.raises(ValueError, match="one channel"):
        calibration.from_ground(echoes(), [(-0.8, 0.8, 4.3, 5.7)])


def test_the_lines_say_what_is_applied():
    found = calibration.from_reflector(echoes(bias=0.42, offset=0.05), REFLECTOR)
    first, second = calibration.as_text(found, ("range",))
    assert first.startswith("range bias: 0.42 +-")
    assert first.endswith("m (applied)")
    assert second.endswith("ms (not applied)")
