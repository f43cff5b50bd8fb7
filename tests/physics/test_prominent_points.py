"""Autofocus by a few strong points, which have no speckle that joins neighbouring positions."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import autofocus, focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo

FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
WAVELENGTH = 299_792_458.0 / 14e9
EXTENT = (-2.5, 2.5, 10.0, 14.0)
POINTS = np.array([[-1.4, 11.1, 0.0], [0.2, 12.6, 0.0], [1.3, 11.8, 0.0]])


@pytest.fixture(scope="module", params=[0.0, 0.1], ids=["points", "among speckle"])
def received(request, rail, scatterers):
    """Three points, and speckle of a hundredth of their power, or none."""
    rng = np.random.default_rng(3)
    count = 4000 if request.param else 0
    places = np.zeros((count, 3))
    places[:, 0] = rng.uniform(*EXTENT[:2], count)
    places[:, 1] = rng.uniform(*EXTENT[2:], count)
    speckle = request.param * np.sqrt(3 / max(count, 1)) * np.ones(count)
    scene = scatterers(np.concatenate([POINTS, places]), np.concatenate([np.ones(3), speckle]))
    return echo.simulate(scene, rail, frequency=FREQUENCY, accuracy_db=-60.0)


def moved(rail, level, *, common, seed=1):
    """The rail with normal errors along all axes, independent from position to position."""
    shape = 1 if common else 2, rail.sizes["position"], 3
    errors = level * WAVELENGTH * np.random.default_rng(seed).standard_normal(shape)
    return trajectory.displaced(rail, np.broadcast_to(errors, (2, *shape[1:])))


def peaks(received, antennas):
    """Level (channel, point), dB, and x (channel, point), m, of what is highest near each point."""
    levels, places = [], []
    for x, y, _ in POINTS:
        axes = x + np.arange(-0.6, 0.6, 0.02), y + np.arange(-0.6, 0.6, 0.02)
        near, far = trajectory.range_extent(antennas, *axes)
        profiles = focusing.compress(received, near_range_m=near, far_range_m=far)
        image = focusing.backproject(profiles, antennas, x=axes[0], y=axes[1])["image"].values
        along_y = np.abs(image).max(axis=1)
        levels.append(20 * np.log10(along_y.max(axis=1)))
        places.append(axes[0][along_y.argmax(axis=1)])
    return np.array(levels).T, np.array(places).T


@pytest.mark.parametrize(
    ("level", "common"), [(0.5, False), (2.0, True)], ids=["half, independent", "two, common"]
)
def test_points_come_back_to_their_peaks(rail, received, level, common):
    recorded = moved(rail, level, common=common)
    whole = peaks(received, rail)[0]
    assert (whole - peaks(received, recorded)[0]).min() > 8
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    assert not found.reason
    assert np.isfinite(found.displacement_std).all()
    after = peaks(received, trajectory.displaced(recorded, found.displacement))[0]
    # Pixels 2 cm apart miss a peak by 0.3 dB at most, with cells of 7.5 and 16 cm.
    assert (whole - after).max() < 0.8


def test_the_images_of_both_channels_lie_on_each_other(rail, received):
    """Independent errors turn each rail by itself, here by 0.4 m at 12 m; cells there are 16 cm."""
    recorded = moved(rail, 2.0, common=False, seed=2)
    ends = recorded["receiver"].values
    turn = [np.polyfit(place[:, 0], place[:, 1], 1)[0] for place in ends]
    assert abs(turn[0] - turn[1]) * 12 > 0.16
    found = autofocus.estimate(received, recorded, extent=EXTENT)
    x = peaks(received, trajectory.displaced(recorded, found.displacement))[1]
    assert np.abs(x[0] - x[1]).max() < 0.16 / 2


@pytest.mark.parametrize("level", [0.3, 1.0])
def test_a_path_that_really_shakes_gets_no_worse(rail, scatterers, level):
    """Its echoes do not fit a smooth path, and the rail as recorded is one."""
    shaken = moved(rail, level, common=True)
    scene = scatterers(POINTS)
    received = echo.simulate(scene, shaken, frequency=FREQUENCY, accuracy_db=-60.0)
    found = autofocus.estimate(received, rail, extent=EXTENT)
    assert found.reason or found.focus[1] > 0.4
    after = peaks(received, trajectory.displaced(rail, found.displacement))[0]
    assert (after - peaks(received, rail)[0]).mean() > -0.5
