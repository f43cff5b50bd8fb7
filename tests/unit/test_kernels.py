"""The kernels' fast ways against slow ones, their bits against threads, their caches."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import dask
import numba
import numpy as np
import pytest
from scipy.interpolate import BSpline

from vinsar.foundations import variables
from vinsar.kernels import (
    backprojection,
    columns,
    functions,
    lookup,
    matched,
    multilook,
    patches,
    splat,
)
from vinsar.kernels.compiling import kernel
from vinsar.processing import filtering, focusing
from vinsar.radar import trajectory, waveform
from vinsar.simulation import echo, scene, visibility

LIGHT = 299_792_458.0
PACKAGE = Path(focusing.__file__).parents[1]
X, Y = np.linspace(-2.5, 2.5, 251), np.linspace(10.0, 10.6, 31)


def decibels(found, exact):
    return 20 * np.log10(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@kernel
def call_phasor(turn, cosine, sine):
    for i in range(turn.size):
        cosine[i], sine[i] = functions.phasor(turn[i])


@kernel
def call_fine_phasor(turn, cosine, sine):
    for i in range(turn.size):
        cosine[i], sine[i] = functions.fine_phasor(turn[i])


@kernel
def call_add(windows, index, base, weights, cosine, sine, table, real, imag):
    matched.add(windows, index, base, weights, cosine, sine, table, table, real, imag)


@kernel
def call_windows(reach, taps):
    return lookup.windows_for(reach, taps)


@kernel
def call_lanes():
    return lookup.lanes()


@pytest.mark.parametrize(("call", "limit_db"), [(call_phasor, -105), (call_fine_phasor, -124)])
def test_the_phasors_err_less_than_they_say(call, limit_db):
    turn = np.linspace(-0.5, 0.5, 100_001).astype(np.float32)
    cosine, sine = np.empty_like(turn), np.empty_like(turn)
    call(turn, cosine, sine)
    exact = np.exp(2j * np.pi * turn.astype(float))
    assert 20 * np.log10(np.abs(cosine + 1j * sine - exact).max()) < limit_db


@pytest.mark.parametrize(("windows", "reach"), [(1, 2), (1, 14), (2, 30)])
@pytest.mark.parametrize("base", [40, -3, 980])
def test_registers_give_the_samples_that_lie_at_the_places(windows, reach, base):
    if call_windows(reach, 4) != windows:
        pytest.skip("this machine has other vector registers")
    rng = np.random.default_rng(windows)
    table = rng.random(1000 + lookup.PADDING).astype(np.float32)
    lanes = call_lanes()
    middle = np.repeat(rng.integers(30, 60, 8 * lookup.LANES // lanes), lanes)
    index = (middle + rng.integers(-reach, reach + 1, middle.size)).astype(np.int32)
    index[lanes // 2 :: lanes] = middle[::lanes]
    if base != 40:
        # Places beyond either end give some sample or other: what counts is that it is one.
        index[:] = rng.integers(-(2**31), 2**31, index.size)
    for tap in range(4):
        # A weight of 1 for one of the four samples, and no turn, leave the sample.
        weights = tuple(np.full(index.size, float(n == tap), np.float32) for n in range(4))
        cosine, sine = np.ones(index.size, np.float32), np.zeros(index.size, np.float32)
        real, imag = np.zeros((2, index.size), np.float32)
        call_add(windows, index, np.int64(base), weights, cosine, sine, table, real, imag)
        np.testing.assert_array_equal(real, imag)
        if base == 40:
            np.testing.assert_array_equal(real, table[base + index + tap])
        assert np.isin(real, table).all()


@pytest.mark.parametrize("taps", [2, 4])
def test_a_window_holds_all_samples_of_a_group(taps):
    widest = {16: 64, 8: 8}[call_lanes()]
    for reach in range(70):
        windows = call_windows(reach, taps)
        size = windows * (32 if widest == 64 else 8)
        # Half a window lies on either side of the middle place, the taps beyond the last one.
        assert windows == 0 or 2 * reach + taps <= size
        if widest == 64:
            assert windows == (1 if 2 * reach + taps <= 32 else 2 * (2 * reach + taps <= 64))


@pytest.fixture(scope="module")
def signal(scatterers, rail):
    rng = np.random.default_rng(3)
    place = rng.uniform([-2.5, 10.0, 0.0], [2.5, 10.6, 0.0], (500, 3))
    frequency = waveform.frequencies(13e9, 15e9, 401)
    return echo.simulate(scatterers(place, rng.random(500)), rail, frequency=frequency)


def image(signal, antennas, x=X, y=Y, **options):
    near, far = trajectory.range_extent(antennas, x, y)
    profiles = focusing.compress(signal, near_range_m=near - 0.1, far_range_m=far + 0.1, **options)
    return focusing.backproject(profiles, antennas, x=x, y=y)["image"].values


# Grids coarser and finer than the positions' spacing of 1 cm, and one beyond all windows.
GRIDS = [(X, Y), (np.linspace(-0.3, 0.3, 121), Y), (np.linspace(-2.5, 2.5, 21), Y)]


@pytest.mark.parametrize(("x", "y"), GRIDS)
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_rail_is_imaged_like_any_positions(signal, rail, interpolation, x, y):
    # A shift by 2 nm is nothing to the image, but too much for a rail.
    other = rail.copy(deep=True)
    other["transmitter"].values[:, 7] += 2e-9
    ways = [
        image(signal, antennas, x, y, interpolation=interpolation) for antennas in (rail, other)
    ]
    # Single precision adds less than -100 dB; 2 nm in one of 81 positions turn it by 2e-6.
    assert decibels(*ways) < -100
    assert not np.array_equal(*ways)


@pytest.mark.parametrize("count", [1, 15, 16, 17, 130, 300])
def test_images_of_any_width_hold_the_same_pixels(signal, rail, count):
    wide = np.linspace(-1.5, 1.49, 300)
    whole = image(signal, rail, wide, Y[:3])
    part = image(signal, rail, wide[:count], Y[:3])
    np.testing.assert_allclose(part, whole[..., :count], atol=1e-5 * np.abs(whole).max())


# First x, spacing, first y, and what is added to the receivers and to the heights of all pixels.
GEOMETRIES = {
    "the paper's": (-1.5, 0.02, 10.0, 0.0, 0.0),
    "coarse": (-3.0, 0.05, 10.0, 0.0, 0.0),
    "aside": (5.0, 0.03, 4.0, 0.0, 0.0),
    "below": (-0.7, 0.01, 0.3, 0.0, 0.0),
    "close by": (-0.7, 0.01, 0.3, 0.0, 1.9),
    "array": (-1.5, 0.02, 10.0, [0.4, -0.2, 0.3], 0.0),
}


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("relief", [0.0, 0.3])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_back_projection_from_any_positions_is_the_double_precision_sum(geometry, relief, cubic):
    x_first, spacing, y_first, apart, above = GEOMETRIES[geometry]
    rng = np.random.default_rng(11)
    x, y = x_first + spacing * np.arange(150), y_first + spacing * np.arange(3)
    z = above + relief * np.sin(3 * x) * np.cos(y)[:, None]
    transmitter = rng.uniform([-0.4, -0.3, 1.9], [0.4, 0.1, 2.4], (9, 3))
    receiver = transmitter + apart
    extra = rng.uniform(-0.05, 0.05, 9)
    pixels = np.stack([*np.meshgrid(x, y), z], axis=-1)
    distance = extra[:, None, None] + 0.5 * sum(
        np.linalg.norm(pixels - antennas[:, None, None], axis=-1)
        for antennas in (transmitter, receiver)
    )
    first, step, cycles = distance.min() - 0.1, 0.0125 if cubic else 0.005, 93.4
    count = int((distance.max() + 0.1 - first) / step)
    profile = np.zeros((2, 9, count + lookup.PADDING), np.float32)
    profile[..., :count] = rng.normal(size=(2, 9, count))
    found = np.zeros(z.shape, np.complex64)
    backprojection.accumulate(
        found, x, y, z, transmitter, receiver, extra, profile[0], profile[1], first, step, cycles,
        cubic,
    )  # fmt: skip
    place = (distance - first) / step
    index = np.floor(place).astype(int)
    share = place - index
    # B-splines of degree 3 and 1, by their distance from the place.
    away = np.abs(share - np.arange(-1, 3)[:, None, None, None])
    wide = np.where(away < 1, 2 / 3 - away**2 * (1 - away / 2), (2 - away).clip(0) ** 3 / 6)
    weights = wide if cubic else (1 - away).clip(0)
    position = np.arange(9)[:, None, None]
    taps = [
        weight * (profile[0] + 1j * profile[1])[position, index + tap - 1]
        for tap, weight in enumerate(weights)
    ]
    exact = np.sum(sum(taps) * np.exp(2j * np.pi * (distance * cycles % 1)), axis=0)
    assert decibels(found, exact) < -100


def test_positions_that_are_not_numbers_read_no_foreign_memory():
    x, y = np.linspace(-1, 1, 40), np.array([10.0, 10.1])
    antennas = np.array([[0.0, 0.0, np.nan], [1e9, 0.0, 2.0], [0.0, 0.0, -np.inf]])
    profile = np.ones((3, 100 + lookup.PADDING), np.float32)
    for cubic in (False, True):
        image_ = np.zeros((2, 40), np.complex64)
        backprojection.accumulate(
            image_, x, y, np.zeros((2, 40)), antennas, antennas, np.zeros(3), profile, profile, 9.0,
            0.01, 93.4, cubic,
        )  # fmt: skip


@pytest.mark.parametrize(("oversampling", "expected"), [(4, -79), (6, -93), (8, -103)])
def test_cubic_interpolation_errs_as_published(scatterers, rail, oversampling, expected):
    rng = np.random.default_rng(4)
    frequency = waveform.frequencies(13e9, 15e9, 101)
    place = rng.uniform([-0.6, 5.4, 0.0], [0.6, 6.6, 0.0], (800, 3))
    data = echo.simulate(scatterers(place), rail, frequency=frequency, accuracy_db=None)
    x, y = np.linspace(-0.6, 0.6, 25), np.linspace(5.4, 6.6, 21)
    grid = np.stack([*np.meshgrid(x, y), np.zeros((21, 25))], axis=-1)
    path = 2 * np.linalg.norm(grid - rail["transmitter"].values[:, :, None, None], axis=-1)
    exact = sum(
        np.einsum(
            "cl,clyx->cyx", data["echo"].values[..., k], np.exp(2j * np.pi * f / LIGHT * path)
        )
        for k, f in enumerate(frequency)
    )
    found = image(data, rail, x, y, oversampling=oversampling, interpolation="cubic")
    error_db = decibels(found, exact / (81 * 101))
    # 2 zeta(8) (1 / 2m)^8 / 9 of a full band's power; speckle over 200 cells scatters by 1 dB.
    assert error_db == pytest.approx(expected, abs=3)


def test_splatting_is_the_adjoint_of_back_projection():
    rng = np.random.default_rng(6)
    x, y = 0.013 * np.arange(40) - 0.26, 5 + 0.017 * np.arange(30)
    surface = 0.1 * rng.random((30, 40))
    antennas = np.stack([np.linspace(-0.4, 0.4, 5), np.zeros(5), np.full(5, 2.0)], axis=1)
    others = antennas + np.array([0.3, -0.1, 0.2])
    step, cycles = 0.006, 93.4
    period = 1200
    amplitude = rng.random((30, 40)).astype(np.float32)
    profile = rng.normal(size=(5, period, 2)).astype(np.float32)
    padded = np.zeros((2, 5, period + lookup.PADDING), np.float32)
    padded[..., :period] = np.moveaxis(profile, -1, 0)
    focused = np.zeros((30, 40), np.complex64)
    backprojection.accumulate(
        focused, x, y, surface, antennas, others, np.zeros(5), padded[0], padded[1], 0.0, step,
        cycles, True,
    )  # fmt: skip
    place = np.stack([*np.meshgrid(x, y), surface]).reshape(3, -1)
    spread = np.zeros((5, period + splat.MOST_TAPS), np.complex64)
    copies = np.zeros((4, spread.shape[1]), np.complex64)
    for bins, out, back in zip(spread, antennas, others, strict=True):
        splat.spread(
            place, amplitude.ravel(), np.ones(1200, bool), out, back, 0.0, cycles / 2,
            1 / (2 * step * period), 4, copies, bins,
        )  # fmt: skip
        assert not copies.any()
    # A facet in bin k adds to k and on; back-projection reads there from sample k - 1 on.
    by_range = np.vdot(spread[:, 1 : period + 1], profile.view(np.complex64)[..., 0])
    by_pixel = np.vdot(amplitude, focused)
    # Sums of 6000 terms in single precision: the norms times some roundings of 6e-8.
    scale = np.linalg.norm(amplitude) * np.linalg.norm(focused)
    assert abs(by_range - by_pixel) < 1e-6 * scale


@pytest.mark.parametrize("taps", [4, 6])
def test_a_facet_is_spread_by_the_b_splines_of_its_place(taps):
    # At 6 m of path, 0.0625 of a period of 20 bins lies 0.25 beyond bin 1.
    bins, copies = np.zeros((2, 20 + splat.MOST_TAPS), np.complex64)
    where = np.array([[0.0], [3.0], [0.0]])
    here = np.zeros(3)
    splat.spread(
        where, np.ones(1, np.float32), np.ones(1, bool), here, here, 0.0, 1 / 24, 0.0625 / 6, taps,
        copies[np.newaxis], bins,
    )  # fmt: skip
    around = np.arange(taps) - (taps // 2 - 1) - 0.25
    exact = BSpline.basis_element(np.arange(taps + 1) - taps / 2, extrapolate=False)(around)
    # A quarter of a cycle at the middle frequency.
    np.testing.assert_allclose(bins[1 : 1 + taps], -1j * exact, atol=1e-6)
    assert not bins[[0]].any()
    assert not bins[1 + taps :].any()


@pytest.mark.parametrize("jitter", [0.0, 1.0])
@pytest.mark.parametrize(("count", "size"), [(401, 0.05), (200, 0.05), (401, 0.03)])
def test_splats_err_less_than_they_say_on_the_papers_facets(rail, jitter, count, size):
    terrain = scene.terrain(
        "peaks", x_min_m=-2.5, x_max_m=2.5, y_min_m=10.0, y_max_m=16.0, spacing_m=0.02,
        peak_height_m=0.3, reflectivity_offset=0.5,
    )  # fmt: skip
    facets = scene.facets(
        terrain, facet_size_m=size, facet_jitter=jitter, rng=np.random.default_rng(1)
    )
    few = rail.isel(position=[0, 60])
    seen = visibility.facet_visibility(terrain, facets, few)
    frequency = waveform.frequencies(13e9, 15e9, count)

    def run(accuracy_db):
        made = echo.simulate(
            facets, few, seen, frequency=frequency, spreading=True, accuracy_db=accuracy_db
        )
        return made["echo"].values

    exact = run(None)
    for accuracy_db in echo.SPLAT_TAPS:
        assert decibels(run(accuracy_db), exact) < accuracy_db


def by_threads(compute):
    """The bits of a result on one thread, on two and on five."""
    results = []
    for options in ({"scheduler": "synchronous"}, *({"num_workers": n} for n in (2, 5))):
        with dask.config.set(scheduler="threads"), dask.config.set(**options):
            results.append(compute().tobytes())
    return results


def test_results_do_not_depend_on_the_threads(signal, rail, scatterers):
    rng = np.random.default_rng(7)
    noise = rng.normal(size=(90, 80, 2)).view(complex)[..., 0].astype(np.complex64)
    cloud = scatterers(rng.uniform([-2, 10, 0], [2, 15, 0.3], (3000, 3)))
    frequency = waveform.frequencies(13e9, 15e9, 51)
    for compute in (
        lambda: filtering.goldstein(noise, alpha=0.7, patch_px=32, step_px=4),
        lambda: image(signal, rail),
        lambda: image(signal, rail.assign(receiver=rail["receiver"] + 0.1)),
        lambda: echo.simulate(cloud, rail, frequency=frequency, accuracy_db=-85)["echo"].values,
        lambda: echo.simulate(cloud, rail, frequency=frequency, accuracy_db=-110)["echo"].values,
    ):
        assert len(set(by_threads(compute))) == 1


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_spectra_are_weighed_by_sums_over_3_x_3_that_wrap_around(alpha):
    parts = np.random.default_rng(3).normal(size=(2, 7, 3, 6, 2)).astype(np.float32)
    spectra = parts.view(np.complex64)[..., 0]
    spectra[1, :, 2] = 0
    weights = np.empty(spectra.shape, np.float32)
    patches.weigh(spectra, alpha, weights)
    for j, i in np.ndindex(2, 3):
        patch, found = np.abs(spectra[j, :, i]), weights[j, :, i]
        shifts = [(down, across) for down in (-1, 0, 1) for across in (-1, 0, 1)]
        sums = sum(np.roll(patch, shift, axis=(0, 1)) for shift in shifts)
        expected = (sums / sums.max()) ** alpha if patch.any() else np.zeros_like(patch)
        # Nine roundings of the sum, and those of the power.
        np.testing.assert_allclose(found, expected, rtol=1.5e-6)


@kernel
def call_power(base, exponent, result):
    for i in range(base.size):
        result[i] = functions.power(base[i], exponent)


@pytest.mark.parametrize("exponent", [0.01, 0.3, 0.8, 1.0])
def test_powers_err_less_than_they_say(exponent):
    base = np.append(np.geomspace(2e-38, 1, 100_000), np.linspace(0.4, 1, 100_000))
    base, exponent = base.astype(np.float32), np.float32(exponent)
    found = np.empty_like(base)
    call_power(base, exponent, found)
    exact = base.astype(float) ** float(exponent)
    # That each power of two below 1 adds 3e-7, and the fits and their sums a few roundings.
    assert (np.abs(found / exact - 1) < 3e-7 * (1 - np.log2(exact))).all()
    call_power(np.float32([0, 1e-39]), exponent, found[:2])
    assert (found[:2] == 0).all()


@pytest.mark.parametrize("holes", [0.0, 0.3])
@pytest.mark.parametrize("shuffle", [0.0, 2.0])
def test_columns_are_resampled_as_numpy_interpolates_but_not_across_holes(holes, shuffle):
    rng = np.random.default_rng(9)
    axis = np.linspace(0, 3, 31)
    place = axis[:, None] + shuffle * rng.random((31, 6))
    place[rng.random(place.shape) < holes] = np.nan
    values, found, share = rng.random(place.shape), np.empty(place.shape), np.empty(place.shape)
    first, second = np.empty((2, *place.shape), np.int32)
    columns.weigh(place, axis, first, second, share)
    columns.resample(values, first, second, share, found)
    for column in range(6):
        known = np.isfinite(place[:, column])
        order = np.argsort(place[known, column], kind="stable")
        at = place[known, column][order]
        gaps = np.cumsum(~known)[known][order]
        exact = np.interp(axis, at, values[known, column][order])
        exact[(axis < at[0] - 0.1) | (axis > at[-1] + 0.1)] = np.nan
        for left, right in np.argwhere(np.diff(gaps))[:, 0][:, None] + [0, 1]:
            for row in np.nonzero((axis > at[left]) & (axis < at[right]))[0]:
                near = [axis[row] - at[left] <= 0.05, at[right] - axis[row] < 0.05]
                sides = values[known, column][order][[left, right]]
                exact[row] = sides[near.index(True)] if any(near) else np.nan
        np.testing.assert_allclose(found[:, column], exact, atol=1e-12)


def test_a_coherence_of_few_rows_is_whole():
    rng = np.random.default_rng(10)
    lower, upper = rng.normal(size=(2, 2, 30, 2)).view(complex)[..., 0]
    found = np.empty((2, 30))
    multilook.coherence(lower, upper, 3, found)
    part = np.s_[:, 4:11]
    power = np.sum(np.abs(lower[part]) ** 2) * np.sum(np.abs(upper[part]) ** 2)
    exact = np.abs(np.vdot(upper[part], lower[part])) / np.sqrt(power)
    np.testing.assert_allclose(found[:, 7], exact)


def test_positions_that_are_not_numbers_are_refused(scatterers, rail):
    facets = scatterers([[0.0, 10.0, 0.0], [np.nan, 11.0, 0.0]])
    with pytest.raises(ValueError, match="not a number"):
        echo.simulate(facets, rail, frequency=np.array([13e9, 14e9]))
    terrain = variables.dataset(
        "terrain",
        {"height": np.zeros((5, 5)), "reflectivity": np.ones((5, 5))},
        {"x": np.arange(5.0), "y": 10 + np.arange(5.0)},
    )
    with pytest.raises(ValueError, match="not a number"):
        visibility.visible_points(
            terrain, np.array([[0.0, 0.0, np.inf]]), facets["facet_position"].values
        )


IMAGES = """
import numpy as np
from vinsar.kernels import backprojection, fan, rail, splat
rng = np.random.default_rng(0)
x, y = np.linspace(-0.4, 0.4, 33), np.linspace(5, 6, 4)
antennas = np.stack([np.linspace(-0.1, 0.1, 5), np.zeros(5), np.full(5, 2.0)], axis=1)
profiles = rng.normal(size=(2, 5, 700)).astype(np.float32)
images, bins = np.zeros((2, 4, 4, 33), np.complex64), np.zeros((2, 1006), np.complex64)
facets, seen = rng.uniform([[0], [5], [0]], [[1], [7], [1]], (3, 300)), rng.random(300) < 0.8
for cubic in (0, 1):
    data = profiles[0], profiles[1], 4.0, 0.01, 93.4, bool(cubic)
    for image, z, apart in zip(images[cubic], (0.0, 0.1, 0.1), (0.0, 0.0, 0.1)):
        surface = z * np.outer(y, x)
        backs = antennas + apart
        backprojection.accumulate(image, x, y, surface, antennas, backs, np.ones(5), *data)
    rail.accumulate(
        images[cubic, 3], x[0], 0.025, y, np.zeros(4), antennas[0], antennas[0], 0.05, 1, 2, *data
    )
    splat.spread(
        facets, np.ones(300, np.float32), seen, antennas[0], antennas[cubic], 5.0, 46.7, 0.0167,
        (4, 6)[cubic], np.zeros((8, 1006), np.complex64), bins[cubic],
    )
# Groups of rays in registers, and a rest; boxes, so that lines of sight are marched.
boxes = rng.choice([0.0, 0.0, 0.3], (12, 10)).repeat(3, 1).astype(np.float32)
boxes = np.pad(boxes, ((0, 0), (0, fan.PADDING)), "edge")
points = rng.uniform([[0], [5], [0]], [[2.9], [6.1], [0.25]], (3, 300))
points[1].sort()
ready = np.searchsorted(points[1], 5 + 0.1 * np.arange(1, 14))
ready[-1] = 300
visible = np.empty(300, bool)
fan.sweep(
    boxes, 0.3, 0.0, 0.1, 5.0, 0.1, np.array([1.0, 0.0, 1.0]), points, ready, 61, visible
)
np.savez({path!r}, images=images.reshape(8, -1), bins=bins, visible=visible)
"""


def python(code, **environment):
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env={k: v for k, v in os.environ.items() if not k.startswith("NUMBA")} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_machines_without_avx_512_and_plain_python_compute_the_same(tmp_path):
    ways = {
        "here": {},
        "avx2": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma"},
        "portable": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
        "python": {"NUMBA_DISABLE_JIT": "1"},
    }
    if call_windows(1, 2) == 0 or call_lanes() == 8:
        ways.pop("avx2")  # This machine has no AVX2, or nothing else.
    made = {}
    for name, environment in ways.items():
        path = str(tmp_path / f"{name}.npz")
        if name != "here":
            environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")
        python(IMAGES.format(path=path), PYTHONPATH=str(PACKAGE.parent), **environment)
        made[name] = np.load(path)
    # They round and fuse differently: single precision's -100 dB.
    for name in ways.keys() - {"here"}:
        for product in ("images", "bins"):
            for found, exact in zip(made[name][product], made["here"][product], strict=True):
                assert np.linalg.norm(found - exact) < 1e-5 * np.linalg.norm(exact)
        # A point or two may lie on the edge of a shadow.
        assert (made[name]["visible"] == made["here"]["visible"]).sum() >= 298
    assert 60 < made["here"]["visible"].sum() < 240


HITS = """
import numpy as np
from vinsar.kernels import paths
out = np.empty(3)
seen = np.ones(3, bool)
n = paths.gather(np.ones((3, 3)), np.ones(3), seen, np.zeros(3), np.zeros(3), 0.0, out, out)
assert n == 3
print(sum(paths.gather.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("writable", ["source", "home", "variable", "nothing"])
def test_compiled_kernels_are_kept_wherever_something_can_be_written(tmp_path, writable):
    package = tmp_path / "lib" / "vinsar"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    home = tmp_path / "home"
    environment = {
        "PYTHONPATH": str(package.parent),
        "HOME": str(home),
        "XDG_CACHE_HOME": str(home / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    if writable != "source":
        # A file where the folder should be stops even those whom permissions do not.
        (package / "kernels" / "__pycache__").touch()
    if writable in ("variable", "nothing"):
        home.touch()
    if writable == "variable":
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / "cache")
    hits = [int(python(HITS, **environment)) for _ in range(2)]
    assert hits == [0, 0 if writable == "nothing" else 1]
    if writable == "variable":
        # A copy elsewhere, of another time, has the same machine code.
        shutil.copytree(package, tmp_path / "other" / "vinsar", copy_function=shutil.copyfile)
        environment["PYTHONPATH"] = str(tmp_path / "other")
        assert int(python(HITS, **environment)) == 1


PROBE = """
import numpy as np
from vinsar.kernels.compiling import kernel
from vinsar.kernels.functions import spline

@kernel
def weights(out):
    out[0], out[1], out[2], out[3] = spline(np.float32(0.2))
"""
WEIGHTS = """
import numpy as np, probe
out = np.empty(4, np.float32)
probe.weights(out)
print(probe.weights.stats.cache_path)
print(*out)
"""

EDITS = """
import importlib
from pathlib import Path
from vinsar.kernels import columns, compiling
for source in Path(columns.__file__).parent.glob("*.py"):
    source.write_bytes(source.read_bytes() + b"# edited")
    importlib.reload(compiling)
    print(compiling.kernel(columns.resample.py_func).stats.cache_path)
"""


def test_an_edit_of_any_kernel_source_reaches_all_machine_code(tmp_path):
    package = tmp_path / "vinsar"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "probe.py").write_text(PROBE, encoding="utf-8")

    def run(code=WEIGHTS):
        environment = {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
        return python(code, **environment).splitlines()

    kept, before = run()
    functions_ = package / "kernels" / "functions.py"
    source = functions_.read_text(encoding="utf-8")
    edited = source.replace("return first, second,", "return first, _HALF * second,")
    functions_.write_text(edited, encoding="utf-8")
    other, after = run()
    assert float(after.split()[1]) == pytest.approx(float(before.split()[1]) / 2)
    assert not Path(kept).exists()
    assert any(Path(other).iterdir())
    folders = {kept, other, *run(EDITS)}
    assert len(folders) == 2 + len(list((package / "kernels").glob("*.py")))


def double(values):
    for i in range(values.size):
        values[i] *= 2


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("size", [0, 1, 100])
def test_a_cache_cut_short_is_made_again(tmp_path, monkeypatch, caplog, suffix, size):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))

    def hits():
        values = np.ones(3)
        compiled = kernel(double)
        compiled(values)
        assert (values == 2).all()
        return sum(compiled.stats.cache_hits.values())

    assert hits() == 0
    (spoilt,) = tmp_path.rglob(f"*.{suffix}")
    whole = spoilt.read_bytes()
    spoilt.write_bytes(whole[:size])
    assert [hits(), hits()] == [0, 1]
    assert "spoilt" in caplog.text
    assert [path.stat().st_size for path in tmp_path.rglob(f"*.{suffix}")] == [len(whole)]


def test_a_cache_that_cannot_be_written_any_more_does_no_harm(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    compiled = kernel(double)
    # A file where the folder should be stops even those whom permissions do not.
    Path(compiled.stats.cache_path).touch()
    values = np.ones(3)
    compiled(values)
    assert (values == 2).all()
    assert "could not be cached" in caplog.text


def test_the_library_starts_without_what_only_kernels_and_figures_need():
    heavy = "numba", "scipy", "dask", "distributed", "matplotlib", "netCDF4"
    code = f"import sys, vinsar.study.pipeline; print([m for m in {heavy} if m in sys.modules])"
    assert python(code, PYTHONPATH=str(PACKAGE.parent)).strip() == "[]"
