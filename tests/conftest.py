"""Shared scenes of the library's tests: small, fixed and free of files."""

from __future__ import annotations

import gc
import os
import signal
import time
from pathlib import Path

# Copies of the sources, wherever tests put them, share what is compiled. Numba asks once.
os.environ.setdefault(
    "NUMBA_CACHE_DIR", str(Path(__file__).parents[1] / "src/vinsar/kernels/__pycache__")
)

import numpy as np
import psutil
import pytest
from hypothesis import settings

from vinsar.foundations import variables
from vinsar.processing import focusing
from vinsar.radar import trajectory
from vinsar.simulation import echo
from vinsar.study import composition  # noqa: F401, which declares all products

settings.register_profile("reproducible", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("reproducible")


def pytest_configure(config):
    """Let what a test starts hear Ctrl-C: workers of pytest ignore it, which is inherited."""
    if hasattr(config, "workerinput"):
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config, items):
    """Begin with the slow folders, the slowest first, so that workers end together."""
    if hasattr(config, "workerinput"):
        slow = ("cluster", "workflow", "figures")
        items.sort(key=lambda item: [name not in item.path.parts for name in slow])


@pytest.fixture(scope="module", autouse=True)
def _nothing_stays_open():
    """Blame a module for the files and sockets that it leaves open, not the tests after it."""
    before = psutil.Process().net_connections(kind="inet")
    yield
    gc.collect()
    # A thread may still be closing what it had.
    until = time.monotonic() + 10
    while left := set(psutil.Process().net_connections(kind="inet")) - set(before):
        assert time.monotonic() < until, left
        time.sleep(0.05)


@pytest.fixture(scope="session")
def rail():
    """The antenna positions of Table 1: a vertical baseline of 0.3 m, the lower antenna at 2 m."""
    return trajectory.rail(
        aperture_length_m=0.8,
        position_spacing_m=0.01,
        rail_height_m=2.0,
        baseline_m=0.3,
        baseline_angle_deg=90.0,
    )


@pytest.fixture(scope="session")
def bistatic(rail):
    """The same transmitters with receivers elsewhere, as a switched array has them."""
    return rail.assign(receiver=rail["receiver"] + [0.3, -0.1, 0.2])


@pytest.fixture(scope="session")
def scatterers():
    """Make the product ``facets`` from positions (facet, 3) and their reflectivity."""

    def make(positions, reflectivity=1.0):
        positions = np.atleast_2d(np.asarray(positions, dtype=float))
        values = np.broadcast_to(np.asarray(reflectivity, float), len(positions)).copy()
        return variables.dataset("facets", {"facet_position": positions, "reflectivity": values})

    return make


@pytest.fixture(scope="session")
def focus():
    """Take facets through echo, range compression and back-projection, without occlusion."""

    def make(facets, antennas, frequency, x, y, z=0.0, **options):
        window = options.get("window", "rectangular")
        near, far = trajectory.range_extent(antennas, x, y, z)
        profiles = focusing.compress(
            echo.simulate(facets, antennas, frequency=frequency, accuracy_db=None),
            near_range_m=near,
            far_range_m=far,
            window=window,
            oversampling=options.get("oversampling", 16),
        )
        return focusing.backproject(profiles, antennas, x=x, y=y, z=z, window=window)

    return make


@pytest.fixture(scope="session")
def ideal_phase():
    """Make the products ``unwrapped`` and ``images`` of a smooth terrain without any radar.

    A pixel (x, y') of the lower image shows the target (x, y, h(x, y)) on its circle; its phase
    is that of the exact ranges (Eq. 1) less the flat-earth phase of the pixel (Eq. 11).
    """

    def make(terrain_height, x, y, *, lower=(0.0, 0.0, 2.0), upper=(0.0, 0.0, 2.3), constant=0.0):
        wavelength = 0.0214
        grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
        true_y = grid_y.copy()
        for _ in range(60):
            height = terrain_height(grid_x, true_y)
            # y of the circle around the lower aperture that passes through the pixel.
            square = (grid_y - lower[1]) ** 2 + lower[2] ** 2 - (lower[2] - height) ** 2
            true_y = lower[1] + np.sqrt(square)

        def difference(*points):
            """r1 - r2."""
            ranges = [
                np.linalg.norm(np.stack(points, -1) - antenna, axis=-1)
                for antenna in (lower, upper)
            ]
            return ranges[0] - ranges[1]

        ground = difference(grid_x, grid_y, np.zeros_like(grid_x))
        phase = -4 * np.pi / wavelength * (difference(grid_x, true_y, height) - ground) + constant
        unwrapped = variables.dataset(
            "unwrapped",
            {"phase": phase, "residue": np.zeros(phase.shape, np.int8)},
            {"x": x, "y": y},
        )
        along = np.array([[-0.4, 0.0, 0.0], [0.4, 0.0, 0.0]])
        antennas = np.array([lower, upper])[:, None] + along
        images = variables.dataset(
            "images",
            {
                "image": np.ones((2, *phase.shape), np.complex64),
                "wavelength": wavelength,
                "transmitter": antennas,
                "receiver": antennas.copy(),
            },
            {"x": x, "y": y},
        )
        return unwrapped, images

    return make
