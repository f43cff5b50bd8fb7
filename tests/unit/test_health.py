"""What is wrong with an echo is named with channel and position, and the rest of it is used."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import vinsar
from vinsar.foundations import variables
from vinsar.processing import classification, health, leakage

ROOT = Path(__file__).parents[2]
SHAPE = (2, 30, 101)


def echo(samples):
    return variables.dataset("received", {"echo": samples}, {"frequency": FREQUENCY})


FREQUENCY = np.linspace(13e9, 15e9, SHAPE[-1])


def speckle(seed=0, shape=SHAPE):
    return np.random.default_rng(seed).normal(size=(*shape, 2)).view(complex)[..., 0]


def warnings(caplog, samples):
    """Return what `sound` makes of samples, and its warnings."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        found = health.sound(echo(samples))
    return found["echo"].values, [record.getMessage() for record in caplog.records]


def test_a_healthy_echo_is_passed_on_as_it_is(caplog):
    data = echo(speckle())
    assert health.sound(data) is data
    assert not caplog.records


def put(value):
    def fault(samples, at):
        samples[at] = value

    return fault


def one_sample(value):
    def fault(samples, at):
        samples[at][..., 7] = value

    return fault


def hang(samples, at):
    samples[at][..., 40:60] = samples[at][..., 40:41]


def one_part(samples, at):
    samples[at] = samples[at].real + 2j


def times(factor):
    def fault(samples, at):
        samples[at] *= factor

    return fault


def repeat(samples, at):
    samples[at] = samples[at[0], at[1].start - 1]


FAULTS = {
    "zero": put(0),
    "constant over all frequencies": put(3 - 2j),
    "constant over all frequencies, a whole number": put(-9999),
    "constant in one of real and imaginary part": one_part,
    "the same as the one before": repeat,
    "stuck for a part of the frequencies": hang,
    "not finite": one_sample(np.nan),
    "not finite, for it overflowed": one_sample(np.inf),
    "filled as if never written": put(9.969209968386869e36 * (1 + 1j)),
    "filled as if never written, one sample": one_sample(9.969209968386869e36),
    "silent, 60 dB and more below the others": times(1e-4),
    "30 dB and more above the others": times(100),
}


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
@pytest.mark.parametrize("kind", FAULTS)
def test_positions_that_say_nothing_are_named_and_left_out_of_all_channels(caplog, kind, dtype):
    samples = speckle().astype(dtype)
    healthy = samples.copy()
    FAULTS[kind](samples, (1, slice(12, 14)))
    given = samples.copy()
    found, said = warnings(caplog, samples)
    name = kind.split(", for")[0].split(", a whole")[0].split(", one sample")[0]
    assert said == [
        f"channel 'upper': positions 12 to 13 are {name}",
        "left out in all channels: 2 of 30 positions (12 to 13)",
    ]
    assert not found[:, 12:14].any()
    rest = np.r_[:12, 14:30]
    np.testing.assert_array_equal(found[:, rest], healthy[:, rest])
    np.testing.assert_array_equal(samples, given)


@pytest.mark.parametrize("channel", [0, 1])
@pytest.mark.parametrize(
    "kind",
    [kind for kind in FAULTS if "others" not in kind],
)
def test_a_channel_that_says_nothing_is_refused_by_name(channel, kind):
    samples = speckle()
    FAULTS[kind](samples, (channel, slice(1, None)))
    name = ("lower", "upper")[channel]
    with pytest.raises(ValueError, match=rf"1 of 30 positions.*channel '{name}': positions 1 to"):
        health.sound(echo(samples))


def test_an_echo_of_zeros_is_refused():
    with pytest.raises(ValueError, match="channel 'lower': positions 0 to 29 are zero"):
        health.sound(echo(np.zeros(SHAPE, complex)))


@pytest.mark.parametrize("factor", [1, -2.5j, 1e-9])
def test_one_echo_for_two_channels_is_refused(factor):
    samples = speckle()
    samples[1] = factor * samples[0]
    with pytest.raises(ValueError, match="'lower' and 'upper' hold the same echo"):
        health.sound(echo(samples))


def test_spikes_are_named_and_left_out_by_themselves(caplog):
    samples = speckle()
    spiked = samples.copy()
    # Beyond 30 medians of 1.2, whatever there was.
    spiked[0, 4, [10, 50]] += 500
    spiked[0, 21, 80] -= 1e9j
    found, said = warnings(caplog, spiked)
    assert said == [
        "channel 'lower': positions 4 and 21 are spiked, 30 times their median and more, in 1.5 % "
        "of the samples"
    ]
    assert not found[0, 4, [10, 50]].any()
    assert found[0, 21, 80] == 0
    same = spiked == samples
    np.testing.assert_array_equal(found[same], samples[same])


def limit_parts(samples, low, high):
    return np.clip(samples.real, low, high) + 1j * np.clip(samples.imag, low, high)


CLIPPED = {
    "both parts": lambda s: limit_parts(s, -1.9, 1.9),
    "one end": lambda s: limit_parts(s, -99, 1.9),
    "whole numbers": lambda s: limit_parts(
        np.round(700 * s.view(float)).view(complex), -2048, 2047
    ),
    "magnitude": lambda s: s * np.minimum(1, 2.4 / np.abs(s)),
}


@pytest.mark.parametrize("kind", CLIPPED)
def test_clipping_is_named_and_the_samples_are_used(caplog, kind):
    samples = speckle()
    clipped = samples * (700 if kind == "whole numbers" else 1)
    # The first positions are near a strong target, and the converter has one range for all.
    clipped[1, 20:] /= 8
    clipped[1] = CLIPPED[kind](clipped[1])
    found, said = warnings(caplog, clipped)
    assert len(said) == 1
    assert re.match(r"channel 'upper': positions 0.* are clipped in \d.*% of the samples", said[0])
    assert " 20" not in said[0]
    np.testing.assert_array_equal(found, clipped)


@pytest.mark.parametrize("bits", [6, 8, 12])
@pytest.mark.parametrize("kind", ["speckle", "one target", "two targets"])
def test_whole_numbers_and_tones_are_not_taken_for_clipped(caplog, bits, kind):
    if kind == "speckle":
        samples = speckle() / 5
    else:
        paths = np.array([[10.0, 10.4]]).T + 0.003 * np.arange(SHAPE[1])
        turn = -4 * np.pi / 299_792_458.0 * FREQUENCY
        samples = np.exp(1j * paths[..., None] * turn)
        if kind == "two targets":
            samples += np.exp(1j * (paths[..., None] + 1.7) * turn)
    top = 2 ** (bits - 1) - 1
    scaled = np.round(samples.view(float) * top / np.abs(samples.view(float)).max()).view(complex)
    for given_ in (samples, scaled):
        assert not warnings(caplog, given_)[1]


@given(
    exponent=st.integers(-120, 118), seed=st.integers(0, 9),
    dtype=st.sampled_from([np.complex64, np.complex128]),
)  # fmt: skip
def test_a_power_of_two_changes_no_digit(exponent, seed, dtype):
    samples = speckle(seed, (2, 8, 33)).astype(dtype)
    data = variables.dataset(
        "received",
        {"echo": samples * dtype(2.0**exponent)},
        {"frequency": np.linspace(13e9, 15e9, 33)},
    )
    found = health.sound(data)["echo"].values
    for one, other in zip(found, samples, strict=True):
        ratio = one[0, 0].real / float(other[0, 0].real)
        assert np.frexp(ratio)[0] == 0.5
        np.testing.assert_array_equal(one, other * ratio)
        # Single precision holds the fourth power of it, a millionth and a million times of it.
        assert 2.0**-16 <= np.median(np.abs(one)) <= 2.0**16


def test_what_is_common_to_the_positions_is_not_put_into_those_left_out():
    samples = speckle() + 50
    samples[:, 5] = 0
    found = leakage.remove_common(echo(samples))["echo"].values
    assert not found[:, 5].any()
    rest = np.r_[:5, 6:30]
    expected = samples[:, rest] - samples[:, rest].mean(axis=1, keepdims=True)
    np.testing.assert_allclose(found[:, rest], expected, atol=1e-12)


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return vinsar.run(study, "dem")


def heights(study, products, samples):
    received = products["received"]
    changed = received.assign(echo=(received["echo"].dims, samples, received["echo"].attrs))
    given_ = {name: products[name] for name in ("trajectory", "recorded_trajectory")}
    return vinsar.run(study, "dem", given={**given_, "received": changed})["dem"]


@pytest.mark.parametrize("exponent", [-100, -27, -5, 4, 27, 100])
def test_heights_are_the_same_bits_at_any_scale(study, products, exponent):
    samples = products["received"]["echo"].values
    for factor in (2.0**exponent, np.array([2.0**exponent, 1.0])[:, None, None]):
        found = heights(study, products, samples * factor)
        xr.testing.assert_identical(found, products["dem"])


@settings(max_examples=6)
@given(factor=st.sampled_from([1e-30, 1e-13, 1e8, 1e30]) | st.floats(1e-30, 1e30))
def test_heights_do_not_depend_on_the_scale(study, products, factor):
    found = heights(study, products, products["received"]["echo"].values * factor)
    kind = found["height_class"].values
    whole = products["dem"]["height_class"].values
    # Roundings of another mantissa: 1e-7 of a cycle of 0.4 m, times a few where it is dark.
    assert (kind != whole).mean() < 0.01
    off = np.abs((found["height"] - products["dem"]["height"]).values[whole == 0])
    assert off.max() < 1e-5


@pytest.mark.parametrize("method", ["none", "echoes"])
def test_a_few_positions_that_are_lost_cost_little(study, products, method, caplog):
    study = study.model_copy(
        update={"autofocus": study.autofocus.model_copy(update={"method": method})}
    )
    products = products | {"dem": heights(study, products, products["received"]["echo"].values)}
    samples = products["received"]["echo"].values.copy()
    samples[1, 3] = 0
    samples[0, 11] = samples[0, 10]
    samples[1, 7, 40] = 1e9
    found = heights(study, products, samples)
    assert "channel 'upper': position 3 is zero" in caplog.text
    assert "channel 'lower': position 11 is the same as the one before" in caplog.text
    assert "channel 'upper': position 7 is spiked" in caplog.text
    valid = (found["height_class"] == classification.VALID).values
    whole = (products["dem"]["height_class"] == classification.VALID).values
    assert valid.sum() > 0.85 * whole.sum()
    both = valid & whole
    off = (found["height"] - products["dem"]["height"]).values[both]
    # Two positions of 21 fewer leave sidelobes of a tenth, which is a tenth of a radian at most.
    std = products["dem"]["height_std"].values[both]
    assert (np.abs(off) < 3 * std).mean() > 0.95
    assert (np.abs(off) < 0.05).mean() > 0.98
