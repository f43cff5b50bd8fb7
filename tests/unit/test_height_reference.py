"""What speaks against the height reference is said with figures; on sound ground nothing is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vinsar
from vinsar.processing import assessment, classification

ROOT = Path(__file__).parents[2]
X, Y = np.linspace(-1, 1, 41), np.linspace(10, 12, 41)
WHERE = (slice(4, 12), slice(10, 20))


def doubts(height, kind, *, level=True, declared=0.0, std=0.01):
    where = WHERE if level else (slice(5, 6), slice(10, 11))
    reference = assessment.Reference((where,), (declared,), plane=False, level=level)
    spread = np.full(height.shape, std)
    return list(assessment.doubts(reference, height, spread, kind, x=X, y=Y))


def ground(seed=0, std=0.01):
    height = np.random.default_rng(seed).normal(scale=std, size=(Y.size, X.size))
    return height, np.zeros(height.shape, np.int8)


def test_ground_as_declared_raises_no_doubt():
    # 80 independent heights: their rms is within 1 +- 0.08 standard deviations.
    for seed in range(50):
        height, kind = ground(seed)
        assert not doubts(height + 0.7, kind, declared=0.7)
        # Nor what is wrong elsewhere.
        height[20:], kind[20:] = 5.0, classification.SHADOW
        assert not doubts(height, kind)


@pytest.mark.parametrize("number", range(1, len(classification.CLASSES)))
def test_a_reference_that_is_not_seen_is_named_with_its_classes(number):
    height, kind = ground()
    kind[4:10, 10:20] = number
    (said,) = doubts(height, kind)
    name = classification.CLASSES[number].replace("_", " ")
    assert "level ground at x = -0.50 to -0.05 m, y = 10.20 to 10.55 m" in said
    assert f"(75 % {name})" in said


def test_a_slope_a_step_and_another_height_are_told_with_their_figures():
    height, kind = ground()
    tilted = height + 0.2 * (X[None, :] - X[10])
    stepped = height + np.where(X[15] > X, -0.05, 0.05)
    for bent in (tilted, stepped, height + 0.06):
        (said,) = doubts(bent, kind)
        away = bent[WHERE]
        rms, mean = np.sqrt(np.mean(away**2)), away.mean()
        assert f"{100 * rms:.1f} cm (rms) off its declared 0 m" in said
        assert f"{rms / 0.01:.1f} times its standard deviation of 1.0 cm" in said
        assert f"{100 * mean:+.1f} cm on average" in said


def test_a_control_point_is_judged_by_its_own_cell():
    height, kind = ground()
    height[5, 10] = 0.21
    assert not doubts(height, kind, level=False, declared=0.2)
    (said,) = doubts(height, kind, level=False, declared=0.1)
    assert "control point at x = -0.50 m, y = 10.25 m comes out 11.0 cm" in said
    kind[5, 10] = classification.INCOHERENT
    (said,) = doubts(height, kind, level=False, declared=0.2)
    assert "100 % incoherent" in said


def test_a_reference_without_any_height_is_doubted_once():
    height, kind = ground()
    height[:], kind[:] = np.nan, classification.OUTSIDE
    (said,) = doubts(height, kind)
    assert "100 % outside" in said


@pytest.fixture(scope="module")
def study():
    return vinsar.load(ROOT / "config/smoke.yaml")


@pytest.fixture(scope="module")
def products(study):
    return vinsar.run(study, "truth", "unwrapped")


def declared(study, products, caplog, x, y):
    rectangle = {"x_min_m": x[0], "x_max_m": x[1], "y_min_m": y[0], "y_max_m": y[1]}
    changed = vinsar.load(ROOT / "config/smoke.yaml", height={"level_ground": [rectangle]})
    assert changed.radar == study.radar
    caplog.clear()
    vinsar.run(changed, "dem", given=products)
    return [r.getMessage() for r in caplog.records if r.levelname == "WARNING"]


def test_in_the_chain_hills_and_shadows_are_doubted_and_level_ground_is_not(
    study, products, caplog
):
    truth = products["truth"]
    assert not declared(study, products, caplog, (-1.45, -1.15), (10.05, 10.35))
    x, y = truth["x"].values, truth["y"].values
    # The steepest lit ground, half a metre square, is bent by decimetres.
    height = np.where(truth["shadow"].values, np.nan, truth["height"].values)
    spread = [
        (np.nanmax(part) - np.nanmin(part), at)
        for at in np.ndindex(y.size // 12 - 1, x.size // 12 - 1)
        for part in [height[12 * at[0] : 12 * at[0] + 12, 12 * at[1] : 12 * at[1] + 12]]
        if np.isfinite(part).all()
    ]
    most, (row, column) = max(spread)
    assert most > 0.1
    at = [(axis[12 * i], axis[12 * i + 11]) for axis, i in ((x, column), (y, row))]
    assert "off its declared 0 m" in " ".join(declared(study, products, caplog, *at))
    # The largest square that is hidden.
    hidden = truth["shadow"].values
    row, column = max(
        np.argwhere(hidden[6:-6, 6:-6]) + 6,
        key=lambda at: hidden[at[0] - 5 : at[0] + 6, at[1] - 5 : at[1] + 6].sum(),
    )
    at = [(axis[i - 3], axis[i + 3]) for axis, i in ((x, column), (y, row))]
    assert "shadow" in " ".join(declared(study, products, caplog, *at))
