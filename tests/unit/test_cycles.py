"""Whole cycles of a long baseline from shorter ones, for targets whose phases are known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.processing import cycles
from vinsar.radar import aperture, trajectory

WAVELENGTH = 299_792_458.0 / 14e9
X, Y = np.linspace(-2.0, 2.0, 41), np.linspace(10.0, 15.0, 51)
POINTS = (np.array([-1.5, 1.5]), np.array([10.5, 10.5]), np.zeros(2))


def rails(baselines, bistatic=False):
    """Apertures of the lower antenna and of others above it, or of such transmitters."""

    def antennas(length):
        options = {"baseline_m": length, "baseline_angle_deg": 90.0}
        if bistatic:
            return trajectory.switched_array(
                baseline_between="transmitters",
                array_length_m=0.8,
                element_spacing_m=0.01,
                array_height_m=2.0,
                transmitter=(0.0, 0.0, 2.1),
                **options,
            )
        return trajectory.rail(
            aperture_length_m=0.8, position_spacing_m=0.01, rail_height_m=2.0, **options
        )

    pairs = [trajectory.apertures(antennas(length)) for length in baselines]
    return [pairs[0][0], *(pair[1] for pair in pairs)]


def heights():
    """Boxes from the ground to 0.9 m, imaged at whole pixels."""
    result = np.zeros((Y.size, X.size))
    for row, column, height in ((20, 8, 0.3), (20, 26, 0.6), (36, 8, 0.45), (36, 26, 0.9)):
        result[row : row + 9, column : column + 9] = height
    return result


def phases(channels, height, errors):
    """Phases of all pairs without the ground's, for the targets that the pixels image."""
    found = []
    grid_x, grid_y = np.broadcast_arrays(X[None, :], Y[:, None])
    true_x, true_y = grid_x.copy(), grid_y.copy()
    for _ in range(12):
        image_x, image_y = aperture.image_position(channels[0], true_x, true_y, height)
        true_x, true_y = true_x + grid_x - image_x, true_y + grid_y - image_y
    for upper, error in zip(channels[1:], errors, strict=True):
        seen = aperture.interferometric_phase(
            channels[0], upper, true_x, true_y, height, WAVELENGTH
        )
        flat = aperture.flat_earth_phase(channels[0], upper, grid_x, grid_y, WAVELENGTH)
        found.append(seen - flat + error)
    return found


@pytest.mark.parametrize("bistatic", [False, True])
@pytest.mark.parametrize("baselines", [(0.06, 0.3), (0.05, 0.15, 0.8)])
def test_boxes_taller_than_the_ambiguity_keep_their_height(baselines, bistatic):
    channels = rails(baselines, bistatic)
    rng = np.random.default_rng(8)
    constants = rng.uniform(-3, 3, len(baselines))
    noise = rng.normal(0, 0.1, (len(baselines), Y.size, X.size))
    exact = phases(channels, heights(), constants[:, None, None] + noise)
    wrapped = [np.angle(np.exp(1j * phase)) for phase in exact]
    told = cycles.told(wrapped[:-1], channels, X, Y, POINTS, WAVELENGTH, window_px=(3, 3))
    found = cycles.settle(wrapped[-1], told, window_px=(3, 3))
    turns = (found - exact[-1]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    # One cycle may lack everywhere: the reference knows it. Corners of the boxes, where the
    # median is the ground's, are 4 of their 81 cells.
    wrong = np.rint(turns) != np.rint(np.median(turns))
    assert wrong.mean() <= 4 * 4 / wrong.size
    assert not wrong[heights() == 0].any()


def test_an_unwrapped_phase_is_moved_by_whole_cycles_where_it_is_wrong():
    channels = rails((0.06, 0.3))
    height = heights()
    exact = phases(channels, height, (0.4, -1.1))
    # What an unwrapper makes of upright walls: the nearest cycle to the ground's.
    flat = phases(channels, 0 * height, (0.4, -1.1))[-1]
    wrong = flat + np.angle(np.exp(1j * (exact[-1] - flat)))
    short = np.angle(np.exp(1j * exact[0]))
    told = cycles.told([short], channels, X, Y, POINTS, WAVELENGTH, window_px=(3, 3))
    found = cycles.settle(wrong + 6 * np.pi, told, window_px=(3, 3), unwrapped=True)
    turns = np.rint((found - exact[-1]) / (2 * np.pi))
    assert (turns != np.median(turns)).mean() <= 4 * 4 / turns.size
    # The case is one: the unwrapper has the boxes wrong.
    assert (np.abs(wrong - exact[-1]) > np.pi).sum() > 200


def test_a_pair_predicts_what_another_pair_measures():
    channels = rails((0.06, 0.3))
    short, long = phases(channels, heights(), (0.0, 0.0))
    found = cycles.predict(
        short, (channels[0], channels[1]), (channels[0], channels[2]), X, Y, WAVELENGTH
    )
    np.testing.assert_allclose(found, long, atol=1e-6)


def test_the_constant_is_that_of_the_reference_points():
    channels = rails((0.06,))
    (phase,) = phases(channels, heights(), (0.0,))
    found = cycles.constant(
        np.angle(np.exp(1j * (phase + 2.9))), tuple(channels), X, Y, POINTS, WAVELENGTH
    )
    assert found == pytest.approx(-2.9, abs=1e-9)


def test_where_shorter_baselines_tell_nothing_the_phase_stays():
    phase = np.linspace(-3, 3, 25).reshape(5, 5)
    np.testing.assert_array_equal(
        cycles.settle(phase, np.full((5, 5), np.nan), window_px=(3, 3), unwrapped=True), phase
    )


def test_a_window_without_a_middle_is_refused():
    with pytest.raises(ValueError, match="odd and positive"):
        cycles.settle(np.zeros((5, 5)), np.zeros((5, 5)), window_px=(3, 4))


def test_pairs_that_do_not_fit_the_channels_are_refused():
    phase = np.zeros((Y.size, X.size))
    with pytest.raises(ValueError, match="do not fit"):
        cycles.told([phase] * 2, rails((0.06, 0.3)), X, Y, POINTS, WAVELENGTH, window_px=(3, 3))


def test_the_window_is_an_odd_number_of_pixels_no_longer_than_asked():
    x, y = np.arange(5) * 0.02, np.arange(5) * 0.05
    assert cycles.window(0.2, x, y) == (5, 11)
    assert cycles.window(0.01, x, y) == (1, 1)


@pytest.mark.parametrize(("rows", "columns"), [(1, 41), (51, 1), (1, 1)])
def test_an_image_of_one_row_or_column_has_its_constant(rows, columns):
    channels, x, y = rails([0.05]), X[:columns], Y[:rows]
    point = x[-1:], y[-1:], np.zeros(1)
    found = cycles.constant(np.full((rows, columns), 0.4), tuple(channels), x, y, point, WAVELENGTH)
    assert found == pytest.approx(-0.4, abs=1e-6)
    assert cycles.window(0.25, x, y) == (1 if rows == 1 else 3, 1 if columns == 1 else 3)
