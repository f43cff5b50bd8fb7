"""Image shifts: Eqs. 6-7, the circle, and what imaged point targets measure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.evaluation import misregistration
from vinsar.foundations import variables
from vinsar.processing import focusing
from vinsar.radar import trajectory, waveform
from vinsar.radar.instrument import Instrument
from vinsar.simulation import echo

FREQUENCY = waveform.frequencies(13e9, 15e9, 201)
HEIGHTS = np.array([-0.3, 0.0, 0.3])
NEAR, FAR = 0, 1


@pytest.fixture(scope="module")
def imager(rail):
    def image_point(target):
        point = variables.dataset(
            "facets", {"facet_position": target[None, :], "reflectivity": np.ones(1)}
        )
        near, far = trajectory.range_extent(rail, target[:1], target[1:2], target[2])
        profiles = focusing.compress(
            echo.simulate(point, rail, frequency=FREQUENCY, accuracy_db=None),
            near_range_m=near - 1.0,
            far_range_m=far + 1.0,
        )
        return lambda x, y: focusing.backproject(profiles, rail, x=x, y=y)["image"].values

    return image_point


@pytest.fixture(scope="module")
def analysis(rail, imager):
    return misregistration.analyze(
        Instrument.of(rail, FREQUENCY),
        imager,
        targets={"near": (3.0, 5.0), "far": (3.0, 15.0)},
        heights=HEIGHTS,
        x=np.linspace(-2.5, 2.5, 11),
        y=np.linspace(10, 16, 13),
        map_height_m=0.3,
    )


def millimetres(analysis, name, target):
    return 1e3 * analysis[name].values[:, target, 2]


def test_eq_7_at_the_papers_near_target(analysis):
    # Lower minus upper: Eq. 6 moves the lower image by (-49.4, -82.3) and the upper by
    # (-57.5, -95.8) mm.
    np.testing.assert_allclose(millimetres(analysis, "radial", NEAR), [8.1, 13.5], atol=0.05)


@pytest.mark.parametrize(("target", "expected"), [(NEAR, 18.45), (FAR, 6.01)])
def test_the_circle_shifts_along_y_alone(analysis, target, expected):
    np.testing.assert_allclose(
        millimetres(analysis, "equal_path", target), [0, expected], atol=0.01
    )


@pytest.mark.parametrize("target", [NEAR, FAR])
def test_imaged_point_targets_measure_the_circle(analysis, target):
    measured, circle = analysis["measured"].values, analysis["equal_path"].values
    # A hundredth of a millimetre of interpolation ripple, ten times over.
    np.testing.assert_allclose(measured[:, target], circle[:, target], atol=1e-4)


def test_imaged_point_targets_contradict_eq_7_near_the_vehicle(analysis):
    difference = np.abs(millimetres(analysis, "measured", NEAR) - [8.1, 13.5])
    assert np.all(difference > 4)


@pytest.mark.parametrize(("channel", "expected"), [(0, -112.26), (1, -130.71)])
def test_each_image_of_the_near_target_lies_on_its_circle(analysis, channel, expected):
    shift = 1e3 * analysis["image_shift"].values[channel, :, NEAR, 2]
    assert abs(shift[0]) < 0.04
    assert shift[1] == pytest.approx(expected, abs=0.1)


def test_targets_on_the_ground_do_not_shift(analysis):
    assert np.abs(analysis["image_shift"].values[..., 1]).max() < 1e-4
    assert not analysis["equal_path"].values[..., 1].any()
    assert not analysis["radial"].values[..., 1].any()


@pytest.mark.parametrize("name", ["radial", "equal_path", "measured"])
def test_registration_error_is_negative_below_the_ground_and_positive_above(analysis, name):
    along_y = analysis[name].sel(ground_axis="y")
    assert np.all(along_y.isel(target_height=0) < 0)
    assert np.all(along_y.isel(target_height=2) > 0)


def test_registration_error_fades_with_distance(analysis):
    near, far = (np.abs(analysis["measured"].values[1, target, 2]) for target in (NEAR, FAR))
    cell = analysis["resolution"].sel(ground_axis="y").values
    assert near > cell[NEAR] / 10
    assert far < cell[FAR] / 10


def test_maps_hold_the_formulas_over_the_scene(analysis):
    radial, circle = analysis["map_radial"].values, analysis["map_equal_path"].values
    y = np.linspace(10, 16, 13)
    shifts = [np.sqrt(y**2 + (h - 0.3) ** 2 - h**2) - y for h in (2.0, 2.3)]
    np.testing.assert_allclose(
        circle[1], np.tile((shifts[0] - shifts[1])[:, None], (1, 11)), atol=1e-12
    )
    assert not circle[0].any()
    # The radial shift is odd in x, and at x = 0 the circle's.
    np.testing.assert_allclose(radial[0], -radial[0][:, ::-1], atol=1e-12)
    np.testing.assert_allclose(radial[1, :, 5], circle[1, :, 5], atol=1e-12)


@given(
    at_x=st.floats(-0.9, 0.9), at_y=st.floats(-0.9, 0.9),
    widths=st.tuples(st.floats(0.05, 0.4), st.floats(0.05, 0.4)), twist=st.floats(-0.5, 0.5),
)  # fmt: skip
def test_peak_of_a_paraboloid_is_found_exactly(at_x, at_y, widths, twist):
    x, y = 3 + 0.01 * np.array([-1, 0, 1]), 7 + 0.02 * np.array([-1, 0, 1])
    u, v = np.meshgrid([-1, 0, 1], [-1, 0, 1])
    u, v = u - at_x, v - at_y
    cross = twist * np.sqrt(widths[0] * widths[1])
    power = 10 - widths[0] * u**2 - widths[1] * v**2 - cross * u * v
    found = misregistration.peak(np.sqrt(power) * np.exp(1j), x, y)
    assert found == pytest.approx((3 + 0.01 * at_x, 7 + 0.02 * at_y), abs=1e-9)
