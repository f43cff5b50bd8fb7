"""Autofocus on measured echoes: a radar moved by hand, its positions from motion capture.

The file is not part of the repository; where it does not lie beside it, nothing is tested.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import uniform_filter1d

from vinsar.foundations import variables
from vinsar.processing import autofocus, focusing, leakage
from vinsar.radar import motion, trajectory

ROOT = Path(__file__).parents[2]
FILE = ROOT.parent / "shared/data/bwsi-two-passes.nc"
WAVELENGTH = 299_792_458.0 / 3.95e9
EXTENT = (-1.5, 2.5, 2.5, 6.5)
X, Y = np.arange(0.2, 1.3, 0.02), np.arange(3.7, 4.7, 0.02)

pytestmark = pytest.mark.skipif(not FILE.exists(), reason="the measured echoes are not there")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    copy = tmp_path_factory.mktemp("measured") / "echoes.nc"
    copy.write_bytes(FILE.read_bytes())
    with xr.open_dataset(copy) as file:
        data = file.transpose("channel", "position", "frequency", "axis").load()
    echo = (data["echo_real"] + 1j * data["echo_imag"]).values.astype(complex)
    ends = {name: data[name].values for name in ("transmitter", "receiver")}
    received = variables.dataset("received", {"echo": echo}, {"frequency": data.frequency.values})
    gated = leakage.suppress(received, method="gate", gate_range_m=1.6)
    return gated, variables.dataset("trajectory", ends)


def reflector(received, antennas):
    """Level (channel,), dB, and place (channel, 2), m, of the corner reflector's peak."""
    near, far = trajectory.range_extent(antennas, X, Y)
    profiles = focusing.compress(received, near_range_m=near - 0.5, far_range_m=far + 0.5)
    image = np.abs(focusing.backproject(profiles, antennas, x=X, y=Y)["image"].values)
    peaks = [np.unravel_index(part.argmax(), part.shape) for part in image]
    level = 20 * np.log10([part[peak] for part, peak in zip(image, peaks, strict=True)])
    return level, np.array([(X[column], Y[row]) for row, column in peaks])


@pytest.mark.parametrize("smoothed", [False, True], ids=["captured", "smoothed"])
def test_the_reflector_keeps_its_peak_and_its_place(measured, smoothed):
    received, captured = measured
    level, place = reflector(received, captured)
    recorded = captured
    if smoothed:
        recorded = captured.assign(
            {
                name: captured[name].copy(data=uniform_filter1d(captured[name].values, 9, axis=1))
                for name in ("transmitter", "receiver")
            }
        )
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    after, moved = reflector(received, trajectory.displaced(recorded, found.displacement))
    assert np.abs(after - level).max() < 0.5
    # A cell of the range is 8.8 cm, of the angle 5 cm at the reflector.
    assert np.abs(moved - place).max() < 0.05


@pytest.mark.parametrize("level", [1.0, 2.0])
def test_noise_of_a_wavelength_and_more_is_told_to_be_too_much(measured, level, caplog):
    """A few strong reflectors before an aperture of a right angle are no level speckle."""
    received, captured = measured

    def draw(channel, positions):
        return motion.errors(
            positions,
            std_m=level * WAVELENGTH,
            distribution="uniform",
            spectrum="white",
            cycles_per_aperture=2.0,
            rng=np.random.default_rng((0, channel)),
        )

    recorded = motion.displace(captured, axis="y", draw=draw)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    assert "agree" in found.reason
    assert found.reason in caplog.text
    assert not found.displacement.any()
