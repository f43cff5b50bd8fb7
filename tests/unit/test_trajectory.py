"""Antenna positions by channel and position."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import vinsar
from vinsar.foundations import constants
from vinsar.radar import trajectory


def make(angle_deg, **changes):
    options = {
        "aperture_length_m": 0.8,
        "position_spacing_m": 0.01,
        "rail_height_m": 2.0,
        "baseline_m": 0.3,
        "baseline_angle_deg": angle_deg,
    }
    return trajectory.rail(**(options | changes))


def test_table_1_has_81_positions_centred_on_the_vehicle(rail):
    x = rail["transmitter"].sel(axis="x")
    assert rail.sizes["position"] == 81
    for channel in ("lower", "upper"):
        np.testing.assert_allclose(x.sel(channel=channel), np.arange(-40, 41) / 100, atol=1e-12)


@pytest.mark.parametrize(
    ("angle", "offset_y", "offset_z"),
    [
        (90.0, 0.0, 0.3),
        (45.0, 0.3 / np.sqrt(2), 0.3 / np.sqrt(2)),
        (0.0, 0.3, 0.0),
        (120.0, -0.15, 0.15 * np.sqrt(3)),
    ],
)
def test_upper_antenna_stands_a_baseline_away_at_its_attitude(angle, offset_y, offset_z):
    antennas = make(angle)["transmitter"]
    lower, upper = antennas.sel(channel="lower").values, antennas.sel(channel="upper").values
    np.testing.assert_array_equal(lower[:, 1:], np.tile([0.0, 2.0], (81, 1)))
    expected = np.tile([0.0, offset_y, offset_z], (81, 1))
    np.testing.assert_allclose(upper - lower, expected, atol=1e-15)


def test_a_vertical_baseline_has_no_forward_offset_at_all(rail):
    assert np.all(rail["transmitter"].sel(axis="y").values == 0)


def test_transmitter_and_receiver_are_equal_but_stand_on_their_own():
    antennas = make(90.0)
    np.testing.assert_array_equal(antennas["transmitter"].values, antennas["receiver"].values)
    assert not np.shares_memory(antennas["transmitter"].values, antennas["receiver"].values)


def test_a_spacing_that_does_not_divide_the_aperture_is_refused():
    with pytest.raises(ValueError, match="not a multiple of the spacing"):
        make(90.0, position_spacing_m=0.03)


ARRAY = {
    "array_length_m": 1.6, "element_spacing_m": 0.02, "array_height_m": 2.0,
    "transmitter": (0.5, -0.1, 2.1), "baseline_m": 0.3, "baseline_angle_deg": 60.0,
}  # fmt: skip


@pytest.mark.parametrize("between", ["transmitters", "receivers"])
def test_an_array_has_one_end_that_stands_still(between):
    antennas = trajectory.switched_array(baseline_between=between, **ARRAY)
    still, elements = antennas["transmitter"].values, antennas["receiver"].values
    np.testing.assert_array_equal(still, np.broadcast_to(still[:, :1], still.shape))
    np.testing.assert_allclose(still[0, 0], [0.5, -0.1, 2.1])
    line = np.linspace(-0.8, 0.8, 81)[:, None] * [1, 0, 0] + [0, 0, 2.0]
    np.testing.assert_allclose(elements[0], line, atol=1e-12)
    step = [0.0, 0.15, 0.15 * np.sqrt(3)]
    apart, common = (still, elements) if between == "transmitters" else (elements, still)
    np.testing.assert_allclose(apart[1] - apart[0], np.tile(step, (81, 1)), atol=1e-12)
    np.testing.assert_array_equal(common[0], common[1])


@pytest.mark.parametrize("system", ["rail", "transmit_pair", "receive_pair"])
def test_the_configuration_names_the_arrangement(system):
    study = vinsar.load()
    lower, upper = trajectory.apertures(
        trajectory.planned(study.radar.model_copy(update={"system": system}))
    )
    place = [0.0, 0.0, 2.0 if system == "rail" else 2.1]
    np.testing.assert_allclose(lower.transmitter, place, atol=1e-12)
    np.testing.assert_allclose(lower.receiver, [0.0, 0.0, 2.0], atol=1e-12)
    moved = upper.transmitter - lower.transmitter, upper.receiver - lower.receiver
    between = {"rail": (0.3, 0.3), "transmit_pair": (0.3, 0.0), "receive_pair": (0.0, 0.3)}
    np.testing.assert_allclose([step[2] for step in moved], between[system], atol=1e-12)


def test_apertures_are_the_lines_of_each_channel(rail, bistatic):
    for antennas, midway in ((rail, [0, 0, 0]), (bistatic, [0.15, -0.05, 0.1])):
        for found, height in zip(trajectory.apertures(antennas), (2.0, 2.3), strict=True):
            np.testing.assert_allclose(found.center, np.add(midway, [0, 0, height]), atol=1e-12)
            for travel in (found.transmitter_travel, found.receiver_travel):
                np.testing.assert_allclose(travel, [0.8, 0, 0], atol=1e-12)


@given(
    left=st.floats(-3, 1), right=st.floats(0.1, 3), near=st.floats(-1, 9),
    depth=st.floats(0.1, 3), low=st.floats(-0.5, 3), high=st.floats(0, 0.5),
)  # fmt: skip
def test_range_extent_encloses_every_range_and_no_more(rail, left, right, near, depth, low, high):
    x, y = np.linspace(left, left + right, 25), np.linspace(near, near + depth, 25)
    z = np.linspace(low, low + high, 9)
    least, most = trajectory.range_extent(rail, x, y, z)
    antennas = rail["transmitter"].values[:, ::8].reshape(-1, 3)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), -1).reshape(-1, 3)
    distance = np.linalg.norm(points[:, None] - antennas[None], axis=-1)
    # The farthest point of a box is a corner. The nearest is within half a diagonal of a sample,
    # and seen from within 0.04 m of one of the antennas taken here.
    half_step = np.linalg.norm([x[1] - x[0], y[1] - y[0], z[1] - z[0]]) / 2
    assert distance.max() == pytest.approx(most, rel=1e-12)
    assert least <= distance.min() + 1e-12
    assert distance.min() <= least + half_step + 0.04


@pytest.mark.parametrize("system", ["rail", "transmit_pair", "receive_pair"])
def test_further_antennas_stand_between_the_lower_and_the_upper_one(system):
    section = vinsar.load().radar.model_copy(update={"system": system})
    two = trajectory.planned(section)
    three = trajectory.planned(section.model_copy(update={"baselines_m": (0.06, 0.3)}))
    assert list(three["channel"].values) == ["lower", "middle", "upper"]
    xr.testing.assert_identical(three.sel(channel=["lower", "upper"]), two)
    step = three.sel(channel="middle") - three.sel(channel="lower")
    whole = three.sel(channel="upper") - three.sel(channel="lower")
    for end in ("transmitter", "receiver"):
        np.testing.assert_allclose(step[end], whole[end] / 5, atol=1e-12)
    pair, every = trajectory.apertures(three), trajectory.all_apertures(three)
    assert len(every) == 3
    np.testing.assert_array_equal(pair[1].center, every[2].center)


def test_channels_are_named_from_the_lowest_to_the_highest():
    assert constants.channel_names(1) == ("lower",)
    assert constants.channel_names(2) == ("lower", "upper")
    assert constants.channel_names(4) == ("lower", "middle 1", "middle 2", "upper")
