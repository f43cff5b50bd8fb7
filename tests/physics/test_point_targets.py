"""Imaged point targets: place, width, phase and gain."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.radar import waveform

LIGHT = 299_792_458.0
FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = LIGHT / 14e9
HEIGHTS = (2.0, 2.3)
RAISED = [(3.0, 5.0, 0.3), (3.0, 15.0, 0.3), (0.0, 8.0, -0.2), (-2.0, 10.0, 0.25)]


def circle(target, antenna_height):
    x, y, z = target
    return x, np.sqrt(y**2 + (antenna_height - z) ** 2 - antenna_height**2)


@pytest.mark.parametrize("target", RAISED)
@pytest.mark.parametrize("channel", [0, 1])
def test_a_raised_target_is_imaged_where_its_circle_meets_the_ground(
    focus, rail, scatterers, target, channel
):
    x, y = circle(target, HEIGHTS[channel])
    # 41 steps of a millimetre either way, a seventh of the range cell and more.
    fine = np.arange(-20, 21) * 1e-3
    images = focus(scatterers(target), rail, FREQUENCY, x + fine, y + fine)
    power = np.abs(images["image"].values[channel]) ** 2
    row, column = np.unravel_index(power.argmax(), power.shape)
    assert abs(fine[row]) < 1.5e-3
    assert abs(fine[column]) < 1.5e-3
    # A parabola through the cuts refines that. Interpolation ripples by 1e-3 of the peak at most;
    # on sinc^2 over the +-20 mm of the fit that moves the top by less than 0.2 mm.
    for cut in (power[20], power[:, 20]):
        second, first, _ = np.polyfit(fine, cut, 2)
        assert abs(-first / (2 * second)) < 0.2e-3


@pytest.mark.parametrize(
    ("target", "shifts"),
    [((3.0, 5.0, 0.3), (-0.11226, -0.13071)), ((3.0, 15.0, 0.3), (-0.03705, -0.04306))],
)
def test_the_papers_targets_shift_along_y_by_the_figures_of_the_method(target, shifts):
    for height, shift in zip(HEIGHTS, shifts, strict=True):
        assert circle(target, height)[1] - target[1] == pytest.approx(shift, abs=1e-5)


@pytest.mark.parametrize("target", RAISED)
@pytest.mark.parametrize("channel", [0, 1])
def test_on_its_circle_a_target_has_gain_1_and_phase_0(focus, rail, scatterers, target, channel):
    x, y = circle(target, HEIGHTS[channel])
    images = focus(scatterers(target), rail, FREQUENCY, np.array([x]), np.array([y]))
    found = images["image"].values[channel, 0, 0]
    # The images of linear interpolation at 16 times: mean of 1 / sinc(f)^2 - 1 is 1.1e-3.
    assert np.abs(found - 1) < 1.2e-3


@pytest.mark.parametrize("target", RAISED)
def test_on_its_own_surface_a_target_stays_where_it_is_in_both_channels(
    focus, rail, scatterers, target
):
    x, y, z = target
    images = focus(scatterers(target), rail, FREQUENCY, np.array([x]), np.array([y]), z=z)
    for found in images["image"].values[:, 0, 0]:
        assert np.abs(found) == pytest.approx(1, abs=1.2e-3)
        assert np.angle(found) == pytest.approx(0, abs=0.01)


def width(axis, values):
    """-3 dB width of a cut through a peak in its middle, by linear interpolation."""
    power = np.abs(values) ** 2 / np.abs(values[axis.size // 2]) ** 2
    half = axis.size // 2
    right = np.interp(-0.5, -power[half:], axis[half:])
    left = np.interp(0.5, power[: half + 1], axis[: half + 1])
    return right - left


@pytest.mark.parametrize("window", ["rectangular", "hann", "hamming", "blackman"])
@pytest.mark.parametrize("y", [6.0, 13.0])
def test_minus_3_db_widths_are_those_of_band_and_aperture(focus, rail, scatterers, window, y):
    fine = np.linspace(-1, 1, 201)
    target = (0.0, y, 0.0)
    slant = np.hypot(y, HEIGHTS[0])
    # N samples a step apart fill N steps: 201 x 10 MHz and 81 x 1 cm. The tapered windows' end
    # samples add or take one step, 1.2 % of the aperture at most.
    cell = LIGHT / (2 * 201 * 10e6)
    azimuth = WAVELENGTH * slant / (2 * 0.81)
    options = {"window": window}
    along = focus(
        scatterers(target), rail, FREQUENCY, 2 * azimuth * fine, np.array([y]), **options
    )["image"].values[0, 0]
    ahead_y = np.sqrt((slant + 2 * cell * fine) ** 2 - HEIGHTS[0] ** 2)
    ahead = focus(scatterers(target), rail, FREQUENCY, np.array([0.0]), ahead_y, **options)[
        "image"
    ].values[0, :, 0]
    factor = waveform.window_width(window)
    assert width(2 * azimuth * fine, along) == pytest.approx(factor * azimuth, rel=0.03)
    assert width(2 * cell * fine, ahead) == pytest.approx(factor * cell, rel=0.03)


def test_first_sidelobe_of_the_rectangular_window_is_minus_13_db(focus, rail, scatterers):
    cell = LIGHT / (2 * 201 * 10e6)
    slant = np.hypot(10.0, 2.0) + np.linspace(1.0, 2.0, 101) * cell
    images = focus(scatterers((0, 10, 0)), rail, FREQUENCY, np.array([0.0]), np.sqrt(slant**2 - 4))
    level = 20 * np.log10(np.abs(images["image"].values[0, :, 0]).max())
    assert level == pytest.approx(-13.26, abs=0.1)
