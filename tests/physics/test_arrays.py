"""Point targets of every antenna arrangement: place, width, phase and height."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.radar import aperture, trajectory, waveform
from vinsar.radar.instrument import Instrument

FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = 299_792_458.0 / 14e9
# N samples a step apart fill N steps: 201 x 10 MHz and 81 x 1 cm.
BAND, LENGTH = FREQUENCY[[0, -1]] + [-5e6, 5e6], 0.81
RAISED = [(0.0, 8.0, -0.2), (-2.0, 10.0, 0.25), (1.0, 15.0, 0.3)]


def array(between, transmitter=(0.0, 0.0, 2.1), angle=90.0, length=0.8):
    return trajectory.switched_array(
        baseline_between=between, array_length_m=length, element_spacing_m=0.01,
        array_height_m=2.0, transmitter=transmitter, baseline_m=0.3, baseline_angle_deg=angle,
    )  # fmt: skip


SYSTEMS = {
    "transmit pair": array("transmitters"),
    "receive pair": array("receivers"),
    "transmitters beside and before the array": array("transmitters", (0.7, 0.3, 1.8), 60.0),
    "transmitter beside two arrays": array("receivers", (-0.6, -0.4, 2.4)),
}
every_system = pytest.mark.parametrize("system", SYSTEMS)
every_target = pytest.mark.parametrize("target", RAISED)


def parabola_top(axis, values):
    second, first, _ = np.polyfit(axis, values, 2)
    return -first / (2 * second)


@every_system
@every_target
def test_a_raised_target_is_imaged_at_its_path_and_slope(focus, scatterers, system, target):
    antennas = SYSTEMS[system]
    for channel, part in enumerate(trajectory.apertures(antennas)):
        x, y = aperture.image_position(part, *target)
        # A tenth of the cells of 36 x 7.5 cm either way.
        across, ahead = np.linspace(-0.03, 0.03, 21), np.linspace(-7e-3, 7e-3, 21)
        image = focus(scatterers(target), antennas, FREQUENCY, x + across, y + ahead)
        power = np.abs(image["image"].values[channel]) ** 2
        # Interpolation ripples by 1e-3 of the power. A parabola fitted to 21 samples of sinc^2
        # over +-t cells moves by 1e-3 / (2 pi^2 t) cells at most: a half per mille of them, and
        # twice that for what the aperture's third order does to a target beside the middle.
        assert abs(parabola_top(across, power[10])) < 1e-3 * 0.36 * 2
        assert abs(parabola_top(ahead, power[:, 10])) < 1e-3 * 0.075


@every_system
@every_target
def test_there_it_has_gain_1_and_phase_0(focus, scatterers, system, target):
    antennas = SYSTEMS[system]
    for channel, part in enumerate(trajectory.apertures(antennas)):
        x, y = aperture.image_position(part, *target)
        image = focus(scatterers(target), antennas, FREQUENCY, np.array([x]), np.array([y]))
        found = image["image"].values[channel, 0, 0]
        # The images of linear interpolation, 1.2e-3, and receivers that see target and pixel at
        # ranges 5 mm apart, so their paths bend otherwise: 2 pi / lambda (L^2 / 24) 5 mm / 64 m^2.
        assert np.abs(found - 1) < 1.2e-3 + 6e-4


def width(axis, values):
    """-3 dB width of a cut through a peak in its middle, by linear interpolation."""
    power = np.abs(values) ** 2 / np.abs(values[axis.size // 2]) ** 2
    half = axis.size // 2
    return np.interp(-0.5, -power[half:], axis[half:]) - np.interp(
        0.5, power[: half + 1], axis[: half + 1]
    )


@every_system
@pytest.mark.parametrize("y", [6.0, 13.0])
def test_minus_3_db_widths_are_those_of_the_paths(focus, scatterers, system, y):
    antennas = SYSTEMS[system]
    lower = trajectory.apertures(antennas)[0]
    filled = aperture.Aperture(
        lower.transmitter, lower.receiver, 0 * lower.receiver_travel,
        LENGTH / 0.8 * lower.receiver_travel,
    )  # fmt: skip
    across, ahead = Instrument(filled, filled, 81, BAND).resolution(0.0, y)
    # One end moves: the cell across is twice that of a rail, lambda r / L.
    slant = float(np.linalg.norm([0, y, lower.receiver[2]]))
    assert across == pytest.approx(WAVELENGTH * slant / LENGTH, rel=1e-2)
    fine = np.linspace(-1, 1, 201)
    factor = waveform.window_width("rectangular")
    for axis, cell in enumerate((across, ahead)):
        place = [np.zeros(1), np.array([y])]
        place[axis] = place[axis] + 2 * cell * fine
        image = focus(scatterers((0.0, y, 0.0)), antennas, FREQUENCY, *place)
        found = width(2 * cell * fine, image["image"].values[0].ravel())
        # The first-order cell; what the path bends over a cell along y is 1 % at 6 m. Along x the
        # range walks off the cell with a transmitter beside the array.
        assert found == pytest.approx(factor * cell, rel=0.03)


@every_system
@every_target
def test_phase_and_height_of_a_raised_target(focus, scatterers, system, target):
    antennas = SYSTEMS[system]
    lower, upper = trajectory.apertures(antennas)
    x, y = aperture.image_position(lower, *target)
    image = focus(
        scatterers(target), antennas, FREQUENCY, np.array([x]), np.array([y]), oversampling=64
    )["image"].values[:, 0, 0]
    found = np.angle(image[0] * np.conj(image[1]))
    flat = aperture.flat_earth_phase(lower, upper, x, y, WAVELENGTH)
    absolute = aperture.interferometric_phase(lower, upper, *target, WAVELENGTH)
    error = np.angle(np.exp(1j * (found - (absolute - flat))))
    # The upper array sees target and pixel at ranges up to 2 cm apart, so their paths bend
    # otherwise: 2 pi / lambda (L^2 / 24) 2 cm / 64 m^2. Interpolation errs by 1e-4 rad.
    assert abs(error) < 2.6e-3
    place = aperture.locate(lower, upper, x, y, absolute + error, WAVELENGTH)
    cycle = Instrument.of(antennas, BAND).height_of_ambiguity(x, y)
    # Its share of a cycle.
    assert place[2] == pytest.approx(target[2], abs=2.6e-3 / (2 * np.pi) * cycle)
    assert np.array(place[:2]) == pytest.approx(target[:2], abs=1e-3)


@every_system
def test_height_of_ambiguity_is_what_turns_the_phase_of_a_pixel_by_a_cycle(system):
    lower, upper = trajectory.apertures(SYSTEMS[system])
    pixel = np.array([0.5, 13.0])
    cycle = float(Instrument.of(SYSTEMS[system], BAND).height_of_ambiguity(*pixel))
    flat = aperture.flat_earth_phase(lower, upper, *pixel, WAVELENGTH)
    ends = flat + 1e-3 * np.array([-1, 1])
    *_, height = aperture.locate(lower, upper, *pixel, ends, WAVELENGTH)
    assert abs(np.diff(height)[0]) * np.pi / 1e-3 == pytest.approx(cycle, rel=1e-5)


def test_a_switched_array_doubles_height_of_ambiguity_and_cell_of_the_rail():
    rail = trajectory.rail(
        aperture_length_m=0.8, position_spacing_m=0.01, rail_height_m=2.0, baseline_m=0.3,
        baseline_angle_deg=90.0,
    )  # fmt: skip
    # Transmitters where the rail has its antennas: the lower channel's ellipse is its circle.
    systems = [
        Instrument.of(antennas, BAND)
        for antennas in (rail, array("transmitters", (0.0, 0.0, 2.0)), array("receivers"))
    ]
    rail_, *arrays = (float(system.height_of_ambiguity(0.0, 13.0)) for system in systems)
    # lambda r2 / 2B for the vertical baseline.
    assert rail_ == pytest.approx(WAVELENGTH * np.hypot(13, 2.3) / 0.6, rel=1e-9)
    # To the ratio of the antenna heights' part in r2.
    assert arrays == pytest.approx([2 * rail_, 2 * rail_], rel=5e-3)
    cells = [system.resolution(0.0, 13.0) for system in systems]
    assert cells[1][0] == pytest.approx(2 * cells[0][0])
    assert cells[1][1] == pytest.approx(cells[0][1])
