from pathlib import Path

import numpy as np
import pytest

from vinsar import claims, pipeline, validation

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def study():
    return validation.load(ROOT / "config/paper.yaml", ROOT / "tests/workflow/tiny.yaml")


@pytest.fixture(scope="module")
def products(study):
    return pipeline.run(study)


def verdicts(products, study):
    return {claim.id: claim for claim in claims.evaluate(products, study)}


def replaced(products, product, **values):
    other = products[product].copy(deep=True)
    for name, value in values.items():
        other[name].values[...] = value
    return products | {product: other}


def test_every_claim_of_figures_2_to_4_is_decided(products, study):
    assert list(verdicts(products, study)) == [
        "F2-sign", "F2-centre", "F2-near-far", "S12-vertical", "S12-critical", "F3-speckle",
        "F3-unwrapped", "F4-95", "F4-std", "F4-max", "F4-alarm",
    ]  # fmt: skip


def test_claims_read_no_section_but_the_declared(products, study):
    part = study.part({name: getattr(study, name) for name in claims.SECTIONS})
    needed = {name: products[name] for name in claims.INPUTS}
    assert claims.as_json(claims.evaluate(needed, part)) == claims.as_json(
        claims.evaluate(products, study)
    )


def test_the_registration_claims_fall_with_the_measurement(products, study):
    shifts = products["registration"]
    found = verdicts(products, study)
    assert found["F2-sign"].verdict == "reproduced"
    assert found["F2-centre"].verdict == "contradicted"
    # A radar whose targets moved radially, as Eqs. 6-7 have it, would reproduce them.
    radial = verdicts(
        replaced(products, "registration", measured=shifts["radial"].values), study
    )
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


def test_an_obstacle_where_there_is_none_breaks_the_claim_of_no_false_alarm(products, study):
    truth = products["truth"]["height"].values
    good = verdicts(replaced(products, "dem", height=truth), study)
    assert good["F4-alarm"].verdict == "reproduced"
    ghost = truth.copy()
    ghost[:, :] = np.where(np.abs(truth) > 0.09, truth, 0)
    ghost[2:12, 2:12] = 0.5
    assert verdicts(replaced(products, "dem", height=ghost), study)["F4-alarm"].verdict == (
        "contradicted"
    )


def test_the_vertical_baseline_is_as_sensitive_as_eq_5_says(products, study):
    figures = verdicts(products, study)["S12-vertical"].figures
    # Eq. 5 at beta = 90 deg is (H0 - h) / B; the exact geometry adds half a baseline to H0.
    assert figures["vertical_m_per_m"] == pytest.approx((2.0 + 0.3) / 0.3, rel=0.02)


def test_the_table_holds_every_claim_with_verdict_and_criterion(products, study):
    found = claims.evaluate(products, study)
    text = claims.as_markdown(found)
    for claim in found:
        assert f"| {claim.id} | {claim.where} | {claim.paper} |" in text
        assert f"| **{claim.verdict}** |" in text
        assert f"- **{claim.id}**: {claim.criterion}" in text
