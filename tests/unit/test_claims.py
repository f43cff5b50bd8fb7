import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import vinsar
from vinsar.paper import claims
from vinsar.processing import detection
from vinsar.study import pipeline
from vinsar.sweeps.sweep import SWEEP, sweep_dataset

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study) | {"sweeps/vibration": shaken()}


LEVELS = [0.0, 0.1, 0.5, 1.0, 2.0, 4.0]
# Height stds in metres by axis: as the paper claims them, over a relief of some 9 cm.
AS_CLAIMED = {
    "x": [0.02, 0.02, 0.025, 0.03, 0.04, 0.041],
    "y": [0.02, 0.045, 0.08, 0.095, 0.1, 0.1],
    "z": [0.02, 0.021, 0.03, 0.035, 0.042, 0.043],
}


def shaken(levels=LEVELS, scatter=0.0, **curves):
    """Make the sweep of Fig. 5 from a std by axis and level; independent errors do ten times."""
    axes = AS_CLAIMED | curves
    realizations = np.array([1 - scatter, 1.0, 1 + scatter])
    one = np.array([list(axes[name]) for name in "xyz"])[:, :, None] * realizations
    std = np.stack([one, 10 * one])
    data = {}
    for name, variable in SWEEP.items():
        values = std
        for size in (4 if dim == "region" else 2 for dim in variable.dims):
            values = np.repeat(values[..., None], size, axis=-1)
        data[name] = values.astype(int) if name == "residues" else values
    swept = {
        "motion_channels": (np.array(["common", "independent"]), {}),
        "motion_axis": (np.array(list("xyz")), {}),
        "motion_level_wavelengths": (np.array(levels), {}),
    }
    return sweep_dataset(data, swept)


def verdicts(products, study):
    return {claim.id: claim for claim in claims.evaluate(products, study)}


def replaced(products, product, **values):
    other = products[product].copy(deep=True)
    for name, value in values.items():
        other[name].values[...] = value
    return products | {product: other}


def test_every_claim_of_figures_2_to_5_is_decided(products, study):
    assert list(verdicts(products, study)) == [
        "F2-sign", "F2-centre", "F2-near-far", "S12-vertical", "S12-critical", "F3-speckle",
        "F3-unwrapped", "F4-95", "F4-std", "F4-max", "F4-alarm", "F5-y", "F5-xz", "F5-bounded",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("common", "independent", "verdict"),
    [(0.026, 0.025, "contradicted"), (0.026, 0.027, "partly"), (0.05, 0.6, "reproduced")],
)
def test_whether_y_must_be_measured_follows_the_sweep_with_autofocus(
    products, study, common, independent, verdict
):
    with_it = shaken(y=[0.02, *[common] * 5])["std"].copy(deep=True)
    with_it.loc[{"motion_channels": "independent"}] = independent
    with_it.loc[{"motion_level_wavelengths": 0}] = 0.02
    sweep = xr.concat([shaken(), shaken().assign(std=with_it)], dim="autofocus_method")
    sweep = sweep.assign_coords(autofocus_method=["none", "echoes"])
    sweep["autofocus_method"].attrs["long_name"] = "autofocus.method"
    with_sweep = study.model_copy(update={"sweeps": study.sweeps | {"autofocus": {}}})
    assert claims.sweeps_of(with_sweep) == ("vibration", "autofocus")
    # Without errors as recorded the independent ones of this sweep have ten times as much.
    sweep["std"].loc[{"motion_level_wavelengths": 0}] = 0.02
    found = verdicts(products | {"sweeps/autofocus": sweep}, with_sweep)
    assert found["F5-y-measured"].verdict == verdict
    assert "F5-y-measured" not in verdicts(products, study)


def test_claims_read_no_section_but_the_declared(products, study):
    part = study.part({name: getattr(study, name) for name in claims.SECTIONS})
    names = [*claims.INPUTS, *(f"sweeps/{name}" for name in claims.SWEEPS)]
    needed = {name: products[name] for name in names}
    assert claims.as_json(claims.evaluate(needed, part)) == claims.as_json(
        claims.evaluate(products, study)
    )


def test_the_registration_claims_fall_with_the_measurement(products, study):
    shifts = products["registration"]
    found = verdicts(products, study)
    assert found["F2-sign"].verdict == "reproduced"
    assert found["F2-centre"].verdict == "contradicted"
    # A radar whose targets moved radially, as Eqs. 6-7 have it, would reproduce them.
    radial = verdicts(replaced(products, "registration", measured=shifts["radial"].values), study)
    assert radial["F2-centre"].verdict == "reproduced"
    mirrored = verdicts(
        replaced(products, "registration", measured=-shifts["measured"].values), study
    )
    assert mirrored["F2-sign"].verdict == "contradicted"


def test_the_accuracy_claims_follow_the_statistics(products, study):
    table = {"fraction_within_tolerance": 0.949, "std": 0.046}
    found = verdicts(replaced(products, "accuracy", **table), study)
    assert (found["F4-95"].verdict, found["F4-std"].verdict) == ("partly", "partly")
    table = {"fraction_within_tolerance": 0.95, "std": 0.045}
    found = verdicts(replaced(products, "accuracy", **table), study)
    assert (found["F4-95"].verdict, found["F4-std"].verdict) == ("reproduced", "reproduced")


def test_a_large_error_on_visible_ground_breaks_the_claim_of_the_worst_error(products, study):
    error = products["accuracy"]["height_error"].values.copy()
    error[:] = 0
    error[2, 2] = 1.0
    assert not products["truth"]["shadow"].values[:6, :8].any()
    found = verdicts(replaced(products, "accuracy", height_error=error), study)
    assert found["F4-max"].verdict == "contradicted"
    assert found["F4-max"].figures["worst_error_m"] == 1.0


def test_a_phase_off_by_a_cycle_breaks_the_claim_of_the_unwrapped_phase(products, study):
    phase = products["unwrapped"]["phase"].values.copy()
    phase[:, : phase.shape[1] // 4] += 2 * np.pi
    found = verdicts(replaced(products, "unwrapped", phase=phase), study)
    assert found["F3-unwrapped"].verdict == "contradicted"
    assert found["F3-unwrapped"].figures["fraction_within_half_a_cycle"] == pytest.approx(
        0.75, abs=0.03
    )


def test_the_claim_of_no_false_alarm_falls_with_what_the_detector_makes_of_level_ground(
    products, study
):
    truth = products["truth"]["height"].values
    real = np.abs(truth) > claims.OBSTACLE_HEIGHT_M
    corner = np.zeros(truth.shape, bool)
    corner[2:6, 2:6] = True
    assert not real[:10, :10].any()

    def decided(alarm, error, elsewhere=detection.FREE):
        kind = np.where(alarm, detection.OBSTACLE, elsewhere)
        changed = replaced(products, "detections", map_class=kind)
        claim = verdicts(replaced(changed, "accuracy", height_error=error), study)["F4-alarm"]
        return claim.verdict, claim.figures

    # Relief is reported, and heights err there alone.
    verdict, figures = decided(real, np.where(real, 0.5, 0))
    assert verdict == "reproduced"
    assert figures["detected_areas"] >= 1
    # Where they err by as much the map has to be cautious.
    verdict, figures = decided(real & False, np.where(real, 0.5, 0), detection.UNKNOWN)
    assert verdict == "reproduced"
    verdict, figures = decided(real & False, np.where(real, 0.5, 0))
    assert verdict == "partly"
    assert figures["cells_with_large_error_taken_for_free"] == real.sum()
    # Level ground errs, unnoticed by the detector; and then noticed.
    verdict, figures = decided(real, np.where(corner, 0.5, 0))
    assert verdict == "partly"
    assert figures["areas_with_large_error_without_obstacle"] == 1
    verdict, figures = decided(real | corner, 0)
    assert verdict == "contradicted"
    assert figures["false_areas"] == 1


def test_the_vertical_baseline_is_as_sensitive_as_eq_5_says(products, study):
    figures = verdicts(products, study)["S12-vertical"].figures
    # Eq. 5 at beta = 90 deg is (H0 - h) / B; the exact geometry adds half a baseline to H0.
    assert figures["vertical_m_per_m"] == pytest.approx((2.0 + 0.3) / 0.3, rel=0.02)


@pytest.fixture(scope="module")
def shaking(products, study):
    """Return the verdicts of Fig. 5's claims for a sweep, over a relief of 9 cm std."""
    truth = products["truth"].copy(deep=True)
    height = truth["height"].values
    truth["height"].values[:] = (height - height.mean()) / height.std() * 0.09

    def decide(sweep):
        found = verdicts(products | {"truth": truth, "sweeps/vibration": sweep}, study)
        return {name: found[name] for name in ("F5-y", "F5-xz", "F5-bounded")}

    return decide


def test_the_claims_of_fig_5_hold_where_the_sweep_is_as_the_paper_says(shaking):
    found = shaking(shaken())
    assert {claim.verdict for claim in found.values()} == {"reproduced"}
    assert found["F5-y"].figures["doubled_y_wavelengths"] == 0.1
    assert found["F5-y"].figures["failed_y_wavelengths"] == 1.0
    assert found["F5-y"].figures["relief_std_m"] == pytest.approx(0.09)
    # Independent errors stand beside the common ones.
    assert "y 9.5 cm" in found["F5-y"].ours
    assert "(independent errors: 30, 95, 35 cm)" in found["F5-y"].ours


def test_another_axis_as_sensitive_as_y_turns_its_claim(shaking):
    # z is worse from 2 wavelengths on: y still doubles first and fails.
    above = [0.02, 0.021, 0.03, 0.035, 0.11, 0.11]
    assert shaking(shaken(z=above))["F5-y"].verdict == "partly"
    # y does nothing at all.
    assert shaking(shaken(y=[0.02] * 6))["F5-y"].verdict == "contradicted"
    # y is worst, but heights survive it.
    mild = [0.02, 0.045, 0.05, 0.055, 0.055, 0.055]
    found = shaking(shaken(y=mild))["F5-y"]
    assert found.verdict == "partly"
    assert found.figures["failed_y_wavelengths"] == np.inf
    assert "fails (a level DEM has 9.0 cm) from no level" in found.ours


def test_the_claim_of_tolerated_errors_turns_at_the_paper_s_own_spread(shaking):
    over = [0.02, 0.02, 0.03, 0.04, 0.0451, 0.0451]
    assert shaking(shaken(x=over))["F5-xz"].verdict == "partly"
    found = shaking(shaken(x=over, z=over))["F5-xz"]
    assert found.verdict == "contradicted"
    assert found.figures["exceeded_x_wavelengths"] == 2.0
    assert found.figures["std_z_m"] == pytest.approx(0.0451)


def test_the_claim_of_a_bounded_spread_turns_with_growth_beyond_scatter(shaking):
    growing = [0.02, 0.021, 0.03, 0.035, 0.04, 0.05]
    found = shaking(shaken(z=growing))["F5-bounded"]
    assert found.verdict == "partly"
    assert found.figures["growth_z"] == pytest.approx(0.25)
    # The same growth within the scatter of the realizations is none.
    assert shaking(shaken(z=growing, scatter=0.3))["F5-bounded"].verdict == "reproduced"
    everything = shaking(shaken(x=growing, y=growing, z=growing))["F5-bounded"]
    assert everything.verdict == "contradicted"


def test_a_sweep_that_lacks_what_a_claim_needs_leaves_it_undecided(shaking):
    few = shaken().sel(motion_level_wavelengths=[0.0, 0.1, 1.0])
    found = shaking(few)
    assert found["F5-y"].verdict == "reproduced"
    assert found["F5-xz"].verdict == "undecided"
    assert "levels of 2 wavelengths or more" in found["F5-xz"].ours
    assert found["F5-bounded"].verdict == "undecided"
    one = shaking(shaken().sel(motion_axis=["y"], motion_channels=["independent"]))
    assert {claim.verdict for claim in one.values()} == {"undecided"}
    assert "motion.channels common, motion.axis x, y and z" in one["F5-y"].ours


def test_what_is_not_finite_stays_out_of_json(shaking):
    calm = [0.02] * 6
    found = shaking(shaken(x=calm, y=calm, z=calm))
    plain = claims.as_json(list(found.values()))
    text = json.dumps(plain, allow_nan=False)
    assert "doubled_x_wavelengths" not in text


def test_the_table_holds_every_claim_with_verdict_and_criterion(products, study):
    found = claims.evaluate(products, study)
    text = claims.as_markdown(found)
    for claim in found:
        assert f"| {claim.id} | {claim.where} | {claim.paper} |" in text
        assert f"| **{claim.verdict}** |" in text
        assert f"- **{claim.id}**: {claim.criterion}" in text
