import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import vinsar
from vinsar.foundations import variables
from vinsar.foundations.errors import ConfigurationError
from vinsar.results import storage
from vinsar.simulation.scene import Scene
from vinsar.study import pipeline
from vinsar.study.composition import StudyModel
from vinsar.study.options import Sweep
from vinsar.sweeps import sweep
from vinsar.sweeps.sweep import SWEEP

ROOT = Path(__file__).parents[2]
STATISTICS = {name for name in SWEEP if SWEEP[name].dims == ("region",)}


@pytest.fixture(scope="module")
def tiny():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(autouse=True)
def memo(monkeypatch):
    """Nothing ready from another test."""
    fresh = sweep.Memo()
    monkeypatch.setattr(sweep, "_MEMO", fresh)
    return fresh


def with_sweep(study, over, realizations=1, base=None):
    raw = {"over": over, "realizations": realizations, "base": base or {}}
    return study.model_copy(update={"sweeps": {"quick": Sweep.model_validate(raw)}})


def in_turn(function, blocks, receive, lost):
    del lost
    for block in blocks:
        receive(function(block))


def nothing(*_):
    pass


def run(study, finished=None, keep=nothing, progress=nothing, compute=in_turn, given=None):
    return sweep.run(
        study,
        "quick",
        finished=finished or {},
        keep=keep,
        progress=progress,
        compute=compute,
        given=given,
    )


OVER = {
    "motion.axis": ["y", "z"],
    "motion.level_wavelengths": [0, 0.1],
    "filtering.goldstein_alpha": [0.3, 0.8],
}


@pytest.fixture(scope="module")
def swept(tiny):
    return run(with_sweep(tiny, OVER, realizations=2))


def test_swept_keys_are_dimensions_with_values_and_units(tiny, swept):
    dims = ("motion_axis", "motion_level_wavelengths", "filtering_goldstein_alpha", "realization")
    assert swept["std"].dims == (*dims, "region")
    assert swept["coherence"].dims == swept["residues"].dims == dims
    assert swept["point_gain"].dims == (*dims, "channel")
    assert list(swept["motion_axis"].values) == ["y", "z"]
    assert list(swept["motion_level_wavelengths"].values) == [0, 0.1]
    assert list(swept["region"].values) == ["whole_scene", "visible_ground", "shadow", "delivered"]
    assert swept["motion_level_wavelengths"].attrs == {
        "long_name": "motion.level_wavelengths",
        "units": "1",
    }
    variables.check(swept, "sweep")
    lengths = with_sweep(tiny, {"radar.baseline_m": [0.2, 0.3], "radar.baseline_angle_deg": [90]})
    found = run(lengths)
    assert found["radar_baseline_m"].attrs["units"] == "m"
    assert found["radar_baseline_angle_deg"].attrs["units"] == "degree"
    found = run(with_sweep(tiny, {"vehicle.forward_speed_m_per_s": [0.0, 1.0]}))
    assert found["vehicle_forward_speed_m_per_s"].attrs["units"] == "m s-1"


def test_every_statistic_is_there_with_its_unit(swept, tiny):
    accuracy = pipeline.run(tiny, only="accuracy")["accuracy"]
    of_regions = {str(name) for name in accuracy.data_vars if accuracy[name].dims == ("region",)}
    assert of_regions - {"cell_count"} == STATISTICS
    focus = {"point_gain", "peak_gain", "peak_shift"}
    others = {"coherence", "residues", "hidden_delivered", "visible_withheld"}
    assert set(swept.data_vars) == STATISTICS | others | focus
    for name in STATISTICS:
        assert swept[name].attrs == accuracy[name].attrs


def test_selecting_and_averaging_is_what_xarray_does(swept):
    at = swept["std"].sel(motion_axis="y", motion_level_wavelengths=0.1, region="visible_ground")
    assert at.mean("realization").shape == (2,)


def test_each_case_is_the_study_of_its_keys_and_realization(tiny, swept):
    for axis, level, alpha, realization in [
        ("y", 0, 0.3, 0),
        ("z", 0.1, 0.8, 1),
        ("y", 0.1, 0.3, 1),
    ]:
        keys = {"axis": axis, "level_wavelengths": float(level)}
        study = tiny.model_copy(
            update={
                "realization": realization,
                "motion": tiny.motion.model_copy(update=keys),
                "filtering": tiny.filtering.model_copy(update={"goldstein_alpha": alpha}),
            }
        )
        products = pipeline.run(study)
        case = swept.sel(
            motion_axis=axis, motion_level_wavelengths=level, filtering_goldstein_alpha=alpha,
            realization=realization,
        )  # fmt: skip
        for name in STATISTICS:
            np.testing.assert_array_equal(case[name], products["accuracy"][name], err_msg=name)
        visible = ~products["truth"]["shadow"].values
        coherence = products["interferogram"]["coherence"].values[visible]
        assert float(case["coherence"]) == float(np.median(coherence))
        assert int(case["residues"]) == np.abs(products["unwrapped"]["residue"]).sum()
        for name, values in products["focus"].data_vars.items():
            np.testing.assert_array_equal(case[name], values, err_msg=name)


def test_a_sweep_is_stored_and_read_as_it_is(swept, tmp_path):
    storage.write(swept, tmp_path / "a.nc", "sweep")
    again = storage.read(tmp_path / "a.nc", "sweep")
    again.attrs = {}
    xr.testing.assert_identical(again, swept)


def test_the_base_holds_for_all_cases_and_realizations_differ(tiny):
    study = with_sweep(tiny, {"echo.snr_db": [10.0]}, 2, {"filtering": {"method": "none"}})
    assert {case.study.filtering.method for case in sweep.cases(study, "quick")} == {"none"}
    std = run(study)["std"].sel(region="whole_scene").values.ravel()
    assert std[0] != std[1]


def test_values_that_are_no_numbers_become_text(tiny):
    study = with_sweep(tiny, {"echo.snr_db": [None, 20.0], "echo.occlusion": [True, False]})
    assert len(sweep.cases(study, "quick")) == 4
    found = run(study)
    assert list(found["echo_snr_db"].values) == ["null", "20.0"]
    assert list(found["echo_occlusion"].values) == ["true", "false"]


# How often each stage is computed, for as many cases as the last number says.
@pytest.mark.parametrize(
    ("over", "once", "every", "cases"),
    [
        (
            {"motion.level_wavelengths": [0.0, 0.1, 0.2], "motion.channels": ["independent"]},
            ("facets", "visibility/lower", "visibility/upper", "echo/lower", "profiles"),
            ("images/lower", "images/upper", "unwrapped", "accuracy", "focus"),
            3,
        ),
        (
            {"filtering.goldstein_alpha": [0.1, 0.5, 0.8]},
            ("echo/lower", "images/lower", "images/upper", "interferogram", "focus", "truth"),
            ("filtered", "unwrapped", "dem", "accuracy"),
            3,
        ),
        (
            {"unwrapping.method": ["whirlwind", "skimage"]},
            ("images/lower", "interferogram", "filtered"),
            ("unwrapped", "dem", "accuracy"),
            2,
        ),
        (
            {"radar.baseline_m": [0.2, 0.3, 0.4]},
            ("terrain", "facets", "visibility/lower", "echo/lower"),
            ("visibility/upper", "echo/upper", "images/upper", "accuracy"),
            3,
        ),
        (
            {"echo.snr_db": [None, 10.0, 20.0]},
            ("visibility/upper", "echo/lower", "echo/upper"),
            ("received", "images/lower", "accuracy"),
            3,
        ),
        (
            {"motion.level_wavelengths": [0.1, 0.2], "motion.affects": ["true"]},
            ("terrain", "facets"),
            ("visibility/lower", "truth", "echo/lower", "images/lower", "focus"),
            2,
        ),
        (
            {"vehicle.forward_speed_m_per_s": [0.0, 1.0], "vehicle.speed_correction": ["none"]},
            ("terrain", "facets", "trajectory"),
            ("visibility/lower", "truth", "echo/lower", "focus"),
            2,
        ),
        # What imaging is told changes nothing of what there is.
        (
            {
                "vehicle.forward_speed_m_per_s": [2.0],
                "vehicle.speed_correction": ["none", "exact"],
            },
            ("true_trajectory", "visibility/lower", "truth", "echo/upper"),
            ("recorded_trajectory", "images/lower", "focus"),
            2,
        ),
        ({"accuracy.tolerance_m": [0.05, 0.1]}, ("dem",), ("accuracy",), 2),
        # Without errors it is the same whatever their axis.
        (
            {"motion.axis": ["x", "y", "z"]},
            ("images/lower", "dem", "accuracy", "focus"),
            ("recorded_trajectory",),
            3,
        ),
    ],
)  # fmt: skip
def test_a_case_computes_only_what_its_keys_change(tiny, memo, over, once, every, cases):
    run(with_sweep(tiny, over))
    assert {name: memo.computed[name] for name in once} == dict.fromkeys(once, 1)
    assert {name: memo.computed[name] for name in every} == dict.fromkeys(every, cases)


def test_realizations_share_what_is_not_drawn(tiny, memo):
    run(with_sweep(tiny, {"motion.level_wavelengths": [0.0, 0.1]}, realizations=2))
    assert memo.computed["terrain"] == memo.computed["truth"] == 1
    assert memo.computed["facets"] == memo.computed["echo/lower"] == 2
    assert memo.computed["dem"] == 4


def test_first_stages_change_slowest(tiny):
    study = with_sweep(
        tiny, {"filtering.goldstein_alpha": [0.1, 0.2], "radar.baseline_m": [0.2, 0.3]}, 2
    )
    order = [
        (case.study.realization, case.study.radar.baseline_m)
        for case in sweep.cases(study, "quick")
    ]
    assert order == sorted(order)
    assert len({case.key for case in sweep.cases(study, "quick")}) == 8


def test_a_memo_keeps_a_bounded_number_of_products(tiny):
    levels = [number / 100 for number in range(1, 13)]
    memo = sweep.Memo(capacity=3)
    for case in sweep.cases(with_sweep(tiny, {"motion.level_wavelengths": levels}), "quick"):
        sweep.run_case(case, memo)
    assert memo.computed["dem"] == 12
    assert set(memo.kept().values()) == {1, 3}
    assert max(memo.kept().values()) == 3


def test_a_stage_that_failed_is_computed_again(tiny, memo, monkeypatch):
    case = sweep.cases(with_sweep(tiny, {"seed": [1]}), "quick")[0]
    stage = pipeline.STAGES["dem"]

    def fail(*_):
        raise ValueError("no height")

    with monkeypatch.context() as patch:
        patch.setitem(pipeline.STAGES, "dem", dataclasses.replace(stage, compute=fail))
        for _ in range(2):
            with pytest.raises(ValueError, match="no height"):
                sweep.run_case(case)
    sweep.run_case(case)
    assert memo.computed["dem"] == 3
    assert memo.computed["unwrapped"] == 1


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ({"radar.baselin_m": [0.3]}, "baselin_m = 0.3: unknown key; did you mean radar.baseline_m"),
        ({"rader.baseline_m": [0.3]}, "unknown key"),
        ({"radar.baseline_m": [0.3, "0.4"]}, "m': '0.4'}: radar.baseline_m = '0.4'"),
        ({"radar.baseline_m": [0.3, -1.0]}, "'radar.baseline_m': -1.0}: radar.baseline_m = -1.0"),
        ({"scene.facet_size_m": [0.03, 0.5]}, "m': 0.5}: scene.facet_size_m = 0.5"),
        ({"filtering.goldstein_patch_px": [16], "filtering.goldstein_step_px": [8, 5]},
         "'filtering.goldstein_step_px': 5}: filtering.goldstein_step_px = 5: must divide"),
        ({"figures.png_dpi": [100, 200]}, "over.figures.png_dpi: no stage of a case reads it"),
        ({"registration.height_count": [3, 5]}, "height_count: no stage of a case reads it"),
        ({"study": ["a", "b"]}, "sweeps.quick.over.study: no stage of a case reads it"),
        ({"realization": [0, 1]}, "is counted by sweeps.quick.realizations"),
        ({"radar.baseline_m": [0.3, 0.2, 0.3]}, "over.radar.baseline_m = '0.3': is listed"),
        ({"motion.level_wavelengths": [1, 1.0]}, "is listed more than once"),
        ({"motion": [{"axis": "q"}]}, "motion.axis = 'q'"),
        ({"motion.level_wavelengths": [0.0, -0.0]}, "is listed more than once"),
        ({"motion": [{"level_wavelengths": 0}, {"level_wavelengths": -0.0}]}, "more than once"),
        ({"motion.axis": ["x"], "motion": [{"axis": "z"}]}, "motion.axis: is within motion"),
        ({"motion": [{"axis": "z"}], "motion.axis": ["x"]}, "motion.axis: is within motion"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_before_anything_runs(tiny, memo, over, said):
    with pytest.raises(ConfigurationError) as caught:
        run(with_sweep(tiny, over))
    assert said in str(caught.value)
    assert "sweeps.quick" in str(caught.value)
    assert memo.computed == {}


def test_a_wrong_base_is_said_once(tiny):
    study = with_sweep(tiny, {"motion.axis": ["x", "y"]}, 2, {"imaging": {"grid_spacing_m": 0.03}})
    with pytest.raises(ConfigurationError) as caught:
        sweep.studies(study, "quick")
    assert "sweeps.quick at {'motion.axis': 'x'}: imaging.grid_spacing_m" in str(caught.value)
    assert "'motion.axis': 'y'" not in str(caught.value)


@pytest.mark.parametrize("wrong", [{}, {"motion.axis": []}])
def test_a_sweep_over_nothing_is_no_configuration(wrong):
    with pytest.raises(ValueError, match="at least 1"):
        with_sweep(StudyModel.model_construct(), wrong)


def failing_at(level):
    stage = pipeline.STAGES["recorded_trajectory"]

    def compute(products, study):
        if study.motion.level_wavelengths in level:
            raise RuntimeError("the mount broke")
        return stage.compute(products, study)

    return dataclasses.replace(stage, compute=compute)


def test_a_case_that_raises_is_named_and_costs_no_other(tiny, memo, monkeypatch):
    study = with_sweep(tiny, {"motion.level_wavelengths": [0.0, 0.1, 0.2]}, realizations=2)
    kept, seen = {}, []
    with monkeypatch.context() as patch:
        patch.setitem(pipeline.STAGES, "recorded_trajectory", failing_at({0.1}))
        with pytest.raises(sweep.SweepError) as caught:
            run(study, keep=kept.update, progress=lambda *numbers: seen.append(numbers))
    said = str(caught.value)
    assert "2 of 6 cases of the sweep 'quick' failed" in said
    for number in (0, 1):
        line = (
            f"motion.level_wavelengths = 0.1, realization {number}: RuntimeError: the mount broke"
        )
        assert line in said
    assert len(kept) == 4
    assert seen == [(count, 6) for count in range(7)]
    # Mended, only the failed ones are computed.
    before = dict(memo.computed)
    again = run(study, finished=kept)
    assert memo.computed["dem"] - before["dem"] == 2
    xr.testing.assert_identical(again, run(study))


def test_many_failures_are_counted_and_not_all_listed(tiny, monkeypatch):
    levels = [0.1 * number for number in range(12)]
    monkeypatch.setitem(pipeline.STAGES, "recorded_trajectory", failing_at(levels))
    with pytest.raises(sweep.SweepError, match="and 2 more") as caught:
        run(with_sweep(tiny, {"motion.level_wavelengths": levels}))
    assert str(caught.value).count("the mount broke") == 10


def test_what_is_finished_is_not_computed_again(tiny, memo):
    study = with_sweep(tiny, {"motion.level_wavelengths": [0.0, 0.1]})
    kept = {}
    first = run(study, keep=kept.update)
    computed = dict(memo.computed)

    def refuse(*_):
        raise AssertionError("there is nothing to compute")

    xr.testing.assert_identical(run(study, finished=kept, compute=refuse), first)
    assert memo.computed == computed
    # Rows of another seed are not this study's.
    other = run(study.model_copy(update={"seed": 99}), finished=kept)
    assert not np.array_equal(other["std"], first["std"])


def test_few_cases_are_spread_and_many_are_bundled():
    sizes = {}
    for count in (1, 64, 640, 5000):
        blocks = sweep._blocks(list(range(count)))
        assert [case for block in blocks for case in block] == list(range(count))
        sizes[count] = len(blocks[0])
    assert sizes == {1: 1, 64: 1, 640: 10, 5000: sweep.CASES_PER_BLOCK}


def with_objects(study):
    box = {"shape": "box", "x_m": 0, "y_m": 11, "size_x_m": 0.4, "size_y_m": 0.4, "height_m": 0.2}
    scene = study.scene.model_dump() | {"terrain": "flat", "objects": [box]}
    return study.model_copy(update={"scene": Scene.model_validate(scene)})


def test_a_scene_with_objects_is_swept_with_how_well_they_are_found(tiny, tmp_path):
    over = {"detection.noise_factor": [3.0, 1e6]}
    found = run(with_sweep(with_objects(tiny), over, realizations=2))
    assert found["height_found"].dims == (
        "detection_noise_factor", "realization", "height_threshold", "object",
    )  # fmt: skip
    rate = found["height_found"].sel(height_threshold=0.05, method="nearest").mean("realization")
    # Nothing exceeds a million times its noise.
    assert rate.values[:, 0].tolist() == [1.0, 0.0]
    assert (found["object_height"] == 0.2).all()
    path = tmp_path / "sweep.nc"
    storage.write(found, path, "sweep")
    xr.testing.assert_identical(storage.read(path, "sweep").drop_attrs(), found.drop_attrs())
    # Without objects nothing of the detection is read.
    with pytest.raises(ConfigurationError, match="no stage of a case reads it"):
        run(with_sweep(tiny, over))


def test_objects_themselves_are_not_swept(tiny):
    over = {"scene.objects": [[], [{"shape": "pit"}]]}
    with pytest.raises(ConfigurationError, match="must be the same in all cases"):
        run(with_sweep(with_objects(tiny), over))


def test_every_case_has_the_terrain_that_is_given(tiny):
    scene = tiny.scene.model_copy(update={"terrain": "file", "file": "dem.tif"})
    own = tiny.model_copy(update={"scene": scene})
    terrain = pipeline.run(tiny, only="terrain")["terrain"]
    given = {"elevation": terrain.assign(height=terrain["height"].copy(data=terrain["height"] / 2))}
    rows = {}
    found = run(with_sweep(own, {"echo.occlusion": [True]}), keep=rows.update, given=given)
    accuracy = pipeline.run(own, "accuracy", given)["accuracy"]
    np.testing.assert_array_equal(found["std"].values[0, 0], accuracy["std"])
    # Another file of the same name is another case: nothing of an earlier run is taken for it.
    other = {"elevation": terrain}
    again = run(with_sweep(own, {"echo.occlusion": [True]}), finished=rows, given=other)
    assert np.abs(again["std"] - found["std"]).min() > 0


def test_realizations_share_one_study(tiny):
    over = {"motion.level_wavelengths": [0.0, 0.1], "filtering.goldstein_alpha": [0.3, 0.8]}
    cases = sweep.cases(with_sweep(tiny, over, 1000), "quick")
    assert len({case.key for case in cases}) == 4000
    # A study is 20 kB in memory: each realization's own would be gigabytes in a large sweep.
    assert len({id(case.first) for case in cases}) == 4
    assert {case.study.realization for case in cases} == set(range(1000))


def test_cases_that_err_on_purpose_warn_of_nothing(tiny, monkeypatch, caplog):
    stage, doubted = pipeline.STAGES["dem"], []

    def doubtful(products, study):
        doubted.append(study)
        logging.getLogger("vinsar.processing.assessment").warning("not known")
        return stage.compute(products, study)

    monkeypatch.setitem(pipeline.STAGES, "dem", dataclasses.replace(stage, compute=doubtful))
    run(with_sweep(tiny, {"motion.level_wavelengths": [0.0, 0.07]}))
    assert doubted
    assert "not known" not in caplog.text
    # Whoever runs a study afterwards in this process is warned again.
    pipeline.run(tiny, only="dem")
    assert "not known" in caplog.text
