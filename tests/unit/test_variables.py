"""Declared variables: what departs from them is refused by name."""

from __future__ import annotations

import numpy as np
import pytest

from vinsar.foundations import variables

DECLARED = [
    (product, name, variable)
    for product, entries in variables.PRODUCTS.items()
    for name, variable in entries.items()
]


def terrain(**changes):
    data = {"height": np.zeros((2, 3)), "reflectivity": np.ones((2, 3))} | changes
    return variables.dataset("terrain", data, {"x": np.arange(3.0), "y": np.arange(2.0)})


def test_a_dataset_has_the_declared_dimensions_attributes_and_coordinates():
    data = terrain()
    assert data["height"].dims == ("y", "x")
    assert data["height"].attrs == {
        "long_name": "true height above the ground plane",
        "units": "m",
    }
    assert data["x"].attrs["units"] == "m"
    assert data["x"].values.tolist() == [0, 1, 2]
    variables.check(data, "terrain")


def test_attributes_of_one_dataset_are_its_owner_s():
    data = terrain()
    for name in ("height", "x"):
        data[name].attrs["units"] = "furlong"
    data.attrs["title"] = "mine"
    again = terrain()
    assert (again["height"].attrs["units"], again["x"].attrs["units"]) == ("m", "m")
    assert again.attrs == {}


def test_labels_and_counts_are_filled_in():
    data = variables.dataset(
        "trajectory", {name: np.zeros((2, 4, 3)) for name in ("transmitter", "receiver")}
    )
    assert data["channel"].values.tolist() == ["lower", "upper"]
    assert data["axis"].values.tolist() == ["x", "y", "z"]
    assert data["position"].values.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"colour": np.zeros((2, 3))}, "has no variable 'colour'"),
        ({"height": np.zeros(3)}, "'height' of product 'terrain' has 1 dimensions"),
        ({"height": np.zeros((2, 3), complex)}, "'height' of product 'terrain' is complex128"),
        ({"height": np.zeros((2, 3), int)}, "'height' of product 'terrain' is int64"),
    ],
)
def test_a_dataset_that_departs_is_not_made(changes, message):
    with pytest.raises(ValueError, match=message):
        terrain(**changes)


def test_a_missing_variable_is_named():
    with pytest.raises(ValueError, match="lacks the variable 'reflectivity'"):
        variables.dataset("terrain", {"height": np.zeros((2, 3))})


def test_sizes_that_disagree_are_refused():
    with pytest.raises(ValueError, match="x"):
        terrain(reflectivity=np.ones((2, 4)))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: data.drop_vars("height"), "lacks the variable 'height'"),
        (lambda data: data.drop_vars("x"), "lacks the variable 'x'"),
        (lambda data: data.assign(extra=data["height"]), "has no variable 'extra'"),
        (lambda data: data.transpose("x", "y"), "'height' .* has the dimensions"),
        (lambda data: data.assign(height=data["height"] > 0), "'height' .* is bool"),
        (lambda data: data.astype(np.float16), "'height' .* is float16"),
        (
            lambda data: data.assign(height=data["height"].assign_attrs(units="km")),
            "'height' .* has units='km', but 'm' is declared",
        ),
        (
            lambda data: data.assign_coords(x=data["x"].assign_attrs(long_name="width")),
            "'x' .* has long_name='width'",
        ),
    ],
)
def test_check_refuses_each_kind_of_departure_by_name(damage, message):
    with pytest.raises(ValueError, match=message):
        variables.check(damage(terrain()), "terrain")


@pytest.mark.parametrize(("product", "name", "variable"), DECLARED)
def test_every_variable_has_a_name_a_unit_and_declared_dimensions(product, name, variable):
    del product, name
    assert variable.long_name
    assert bool(variable.units) != (variable.kind == "label")
    assert set(variable.dims) <= set(variables.COORDINATES)
    assert len(set(variable.dims)) == len(variable.dims)
    words = len(variable.flag_meanings.split())
    # Integers may be classes.
    assert words == 2 if variable.kind == "flag" else (not words or variable.kind == "integer")


def test_every_coordinate_is_one_dimensional_and_named():
    for name, variable in variables.COORDINATES.items():
        assert variable.dims == (name,)
        assert variable.long_name
        assert bool(variable.units) != (variable.kind == "label")


def test_every_unit_is_one_that_udunits_knows():
    units = {variable.units for _, _, variable in DECLARED}
    units |= {variable.units for variable in variables.COORDINATES.values()}
    assert units <= {"", "1", "m", "m2", "Hz", "radian"}


def test_inputs_are_not_changed_and_results_come_in_one_order():
    coords = {"y": np.arange(2.0), "x": np.arange(3.0)}
    kept = dict(coords)
    data = {"height": np.zeros((2, 3)), "reflectivity": np.ones((2, 3))}
    first = variables.dataset("terrain", data, coords)
    second = variables.dataset("terrain", data, dict(reversed(coords.items())))
    assert coords.keys() == kept.keys()
    assert list(first.variables) == list(second.variables)


def interferogram(**changes):
    values = {"interferogram": np.ones((2, 3), np.complex64), "coherence": np.full((2, 3), 0.5)}
    for name, value in changes.items():
        values[name][1, 2] = value
    axes = {"y": np.arange(2.0), "x": np.arange(3.0)}
    return variables.dataset("interferogram", values, axes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coherence": np.nan}, "1 of the 6 values of 'coherence' .* are missing; .* x number 2"),
        ({"interferogram": np.nan * 1j}, "'interferogram' .* are missing"),
        ({"coherence": np.inf}, "'coherence' .* are infinite; the first at y number 1, x number 2"),
        ({"interferogram": complex(0, -np.inf)}, "'interferogram' .* are infinite"),
        ({"coherence": 1.001}, "'coherence' .* are outside 0 to 1"),
        ({"coherence": -0.001}, "'coherence' .* are outside 0 to 1"),
    ],
)
def test_values_that_cannot_be_are_refused_by_name_and_place(changes, message):
    with pytest.raises(ValueError, match=message):
        variables.refuse_values(interferogram(**changes), "interferogram")


def test_what_is_bounded_may_reach_its_bound_and_a_rounding_more():
    variables.refuse_values(interferogram(coherence=1.0 + 1e-7), "interferogram")
    variables.refuse_values(interferogram(coherence=0.0), "interferogram")


def test_values_may_be_missing_where_something_misses_in_what_they_are_made_from():
    whole, lacking = interferogram(), interferogram(coherence=np.nan)
    variables.refuse_values(lacking, "interferogram", {"filtered": whole, "images": lacking})
    with pytest.raises(ValueError, match="are missing"):
        variables.refuse_values(lacking, "interferogram", {"filtered": whole})
    # Nor do gaps excuse what else is wrong.
    wrong = interferogram(coherence=np.nan)
    wrong["coherence"][0, 0] = 2.0
    with pytest.raises(ValueError, match=r"1 of the 6 .* outside 0 to 1"):
        variables.refuse_values(wrong, "interferogram", {"images": lacking})


def test_a_class_without_a_word_is_refused():
    found = variables.PRODUCTS["dem"]["height_class"]
    assert found.limits == (0, len(found.flag_meanings.split()) - 1)
    data = variables.dataset(
        "dem",
        {name: np.zeros((1, 1)) for name in variables.PRODUCTS["dem"]}
        | {"height_class": np.full((1, 1), found.limits[1] + 1, np.int8)},
        {"y": [0.0], "x": [0.0]},
    )
    with pytest.raises(ValueError, match=r"1 of the 1 values of 'height_class' .* outside 0 to 5"):
        variables.refuse_values(data, "dem")
