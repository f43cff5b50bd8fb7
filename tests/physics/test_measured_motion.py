"""Autofocus on measured echoes: a radar moved by hand, its positions from motion capture.

The files are not part of the repository; docs/own-data.md says where they are from. The table of
docs/autofocus.md:

.venv/bin/python tests/physics/test_measured_motion.py
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import uniform_filter1d

from vinsar.foundations import variables
from vinsar.processing import autofocus, focusing, leakage
from vinsar.radar import trajectory
from vinsar.simulation import echo  # noqa: F401  (declares the product received)

FOLDER = Path(os.environ.get("VINSAR_DATA", Path(__file__).parents[3] / "shared/data"))
PASSES = FOLDER / "bwsi-two-passes.nc"
WAVELENGTH = 299_792_458.0 / 3.95e9
EXTENT = (-1.5, 2.5, 2.5, 6.5)
X, Y = np.arange(0.2, 1.3, 0.02), np.arange(3.7, 4.7, 0.02)
# The reflector spans 0.63 of the sine of angle: cells in x, and in y of the range, m.
CELLS = np.array([WAVELENGTH / (2 * 0.63), 299_792_458.0 / (2 * 1.695e9)])

pytestmark = pytest.mark.skipif(
    not PASSES.is_file(),
    reason=f"the measured echoes are not in {FOLDER} (VINSAR_DATA names another folder)",
)


def passes():
    """Return echoes and captured positions of the two passes."""
    with xr.open_dataset(PASSES) as file:
        data = file.transpose("channel", "position", "frequency", "axis").load()
    samples = (data["echo_real"] + 1j * data["echo_imag"]).values.astype(complex)
    ends = {name: data[name].values for name in ("transmitter", "receiver")}
    received = variables.dataset(
        "received", {"echo": samples}, {"frequency": data.frequency.values}
    )
    gated = leakage.suppress(received, method="gate", gate_range_m=1.6)
    return gated, variables.dataset("trajectory", ends)


@pytest.fixture(scope="module")
def measured():
    return passes()


def reflector(received, antennas):
    """Level (channel,), dB, and place (channel, 2), m, of the corner reflector's peak."""
    near, far = trajectory.range_extent(antennas, X, Y)
    profiles = focusing.compress(received, near_range_m=near - 0.5, far_range_m=far + 0.5)
    image = np.abs(focusing.backproject(profiles, antennas, x=X, y=Y)["image"].values)
    peaks = [np.unravel_index(part.argmax(), part.shape) for part in image]
    level = 20 * np.log10([part[peak] for part, peak in zip(image, peaks, strict=True)])
    return level, np.array([(X[column], Y[row]) for row, column in peaks])


def smoothed(captured):
    moved = {
        name: captured[name].copy(data=uniform_filter1d(captured[name].values, 9, axis=1))
        for name in ("transmitter", "receiver")
    }
    return captured.assign(moved)


def noise(captured, level, *, common, seed=0):
    """Errors (channel, position, axis), m, as of a sensor: normal, independent by position."""
    channels, positions = captured.sizes["channel"], captured.sizes["position"]
    draws = np.random.default_rng((7, seed)).standard_normal(
        (1 if common else channels, positions, 3)
    )
    return np.broadcast_to(level * WAVELENGTH * draws, (channels, positions, 3))


def line(captured, channels):
    """The displacement (channel, position, axis) of whole passes to straight lines, evenly run."""
    place = captured["receiver"].values
    along = np.linspace(-1, 1, place.shape[1])
    basis = np.linalg.qr(np.stack([np.ones_like(along), along], axis=1))[0]
    moved = np.zeros_like(place)
    moved[channels] = (basis @ (basis.T @ place) - place)[channels]
    return moved


def carried_along(captured, errors):
    """What the constant and the trend of errors move the reflector by (channel, 2), m.

    A shift and a turn of all positions, which no echo contradicts: the image shifts and turns. The
    passes see one reflector: they share their turn.
    """
    place = captured["receiver"].values
    along = place[..., 0] - place[..., 0].mean(axis=1, keepdims=True)
    shift = errors.mean(axis=1)
    turn = np.einsum("cl,cli->ci", along, errors) / (along**2).sum(axis=1, keepdims=True)
    turn = np.broadcast_to(turn.mean(axis=0), turn.shape)
    x, y = 0.74, 4.15
    height = place[..., 2].mean(axis=1)
    lifted = shift[:, 2] + turn[:, 2] * x
    moved_x = shift[:, 0] - turn[:, 1] * y + turn[:, 2] * height
    moved_y = shift[:, 1] + turn[:, 1] * x - lifted * height / y
    return np.stack([moved_x, moved_y], axis=1)


def refocused(measured, recorded):
    """Loss of the peak (channel,), dB, and its place (channel, 2) in cells, against captured."""
    received, captured = measured
    level, place = reflector(received, captured)
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    after, moved = reflector(received, trajectory.displaced(recorded, found.displacement))
    return found, level - after, (moved - place) / CELLS


def test_the_captured_positions_keep_the_peak_and_its_place(measured):
    for recorded in (measured[1], smoothed(measured[1])):
        _, loss, place = refocused(measured, recorded)
        assert loss.max() < 0.5
        assert np.abs(place).max() < 1


@pytest.mark.parametrize(
    ("level", "common"), [(1.0, True), (2.0, False)], ids=["common", "independent"]
)
def test_noise_of_a_wavelength_and_more_is_taken_out(measured, level, common):
    received, captured = measured
    errors = noise(captured, level, common=common)
    recorded = trajectory.displaced(captured, errors)
    lost = reflector(received, captured)[0] - reflector(received, recorded)[0]
    assert lost.min() > 10
    found, loss, place = refocused(measured, recorded)
    assert not found.reason
    assert loss.max() < 0.5
    # The place carries the shift and the turn of the navigated positions, and no more.
    assert np.abs(place - carried_along(captured, errors) / CELLS).max() < 1


def test_a_straight_line_stands_in_for_the_path_of_a_pass(measured):
    received, captured = measured
    recorded = trajectory.displaced(captured, line(captured, [0]))
    lost = reflector(received, captured)[0] - reflector(received, recorded)[0]
    assert lost[0] > 1.5
    _, loss, place = refocused(measured, recorded)
    assert loss.max() < 0.5
    assert np.abs(place).max() < 1


def table(seeds=10):
    """Return the table of docs/autofocus.md."""
    measured = passes()
    received, captured = measured
    level = reflector(received, captured)[0]
    still = np.zeros(captured["receiver"].shape)
    cases = {
        "captured": [still],
        "smoothed over nine positions": [
            (smoothed(captured)["receiver"] - captured["receiver"]).values
        ],
        "a straight line for one pass": [line(captured, [0]), line(captured, [1])],
        "straight lines for both": [line(captured, [0, 1])],
    }
    for wavelengths in (0.5, 1.0, 2.0):
        for mode in ("common", "independent"):
            cases[f"noise, {wavelengths:g} λ, {mode}"] = [
                noise(captured, wavelengths, common=mode == "common", seed=seed)
                for seed in range(seeds)
            ]
    rows = [
        "| navigated positions | loss as they are, dB | loss with autofocus, dB | "
        "place, cells | less shift and turn, cells |",
        "|---|---|---|---|---|",
    ]
    for name, all_errors in cases.items():
        worst = np.full(4, -np.inf)
        for errors in all_errors:
            recorded = trajectory.displaced(captured, errors)
            before = level - reflector(received, recorded)[0]
            _, loss, place = refocused(measured, recorded)
            rest = place - carried_along(captured, errors) / CELLS
            case = before.max(), loss.max(), np.abs(place).max(), np.abs(rest).max()
            worst = np.maximum(worst, case)
        rows.append(f"| {name} | " + " | ".join(f"{value:.1f}" for value in worst) + " |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(table())  # noqa: T201
