"""Configurations of values that nobody means: each is refused in sentences or stands, soon.

Over the schema: any keys, any values of any kind; extremes of the kind that is asked for most.
"""

import copy
import math
import random
import resource
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel

from vinsar.foundations.errors import ConfigurationError
from vinsar.study import ingest, validation, work
from vinsar.study.composition import StudyModel
from vinsar.sweeps import sweep

PAPER = yaml.safe_load((Path(__file__).parents[2] / "config/paper.yaml").read_text())
KEYS = [
    (name, key)
    for name, field in StudyModel.model_fields.items()
    for key in (
        field.annotation.model_fields
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel)
        else [None]
    )
]
FLOATS = [
    0.0, -0.0, 1e-300, 1e-12, 8e-10, 1e-6, 1e-4, 0.001, 0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 100.0, 1e3,
    1e6, 1e9, 1e15, 1e300, -1.0, -1e6, math.inf, math.nan,
]  # fmt: skip
WHOLE = [0, 1, 2, 3, 4, 5, 7, 9, 16, 99, 101, 9999, 10**6, 10**7 + 1, 10**9, 10**18, 10**30, -1]
ODD = [None, True, "", "x", "1e9", [], [1], {}, {"a": 1}, {"": 1}, "x" * 300, "\x1b[2J", [[]]]
BATCHES, EACH = 6, 60


def value(draw, old):
    """Return a value in place of another, mostly of its kind."""
    if draw.random() < 0.15:
        return draw.choice(ODD)
    if isinstance(old, bool):
        return not old
    if isinstance(old, int):
        return draw.choice(WHOLE)
    if isinstance(old, float):
        scaled = old * draw.choice([1e-4, 0.01, 0.1, 0.5, 2, 10, 100])
        return draw.choice(FLOATS) if draw.random() < 0.7 else scaled
    return draw.choice(ODD + FLOATS)


def configuration(draw):
    raw = copy.deepcopy(PAPER)
    for section, key in draw.sample(KEYS, draw.choice([1, 1, 2, 3])):
        if key is None:
            raw[section] = value(draw, raw[section])
        else:
            raw[section][key] = value(draw, raw[section][key])
    return raw


@pytest.fixture(autouse=True)
def _a_machine_of_16_gb(monkeypatch):
    monkeypatch.setattr(work, "memory", lambda: 16e9)


@pytest.mark.parametrize("seed", range(BATCHES))
def test_any_configuration_is_refused_in_sentences_or_stands(seed):
    draw = random.Random(seed)  # noqa: S311
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said, stood = [], 0
    for _ in range(EACH):
        raw = configuration(draw)
        try:
            study = ingest.check(raw)
        except ConfigurationError as error:
            said += str(error).split("\n")
        else:
            stood += 1
            said += [*validation.advice(study), work.sentence(study)]
    assert all(sentence.isprintable() for sentence in said)
    # Kilobytes: nothing of the size that was asked for has been made.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e6
    # Else nothing but refusals would have been tried.
    assert 0 < stood < EACH


SWEPT = [[], [None], ["x"], [{}], [[]], [1e300], [-1.0], [0.0, 1.0], [math.nan], [True, False]]


def test_any_sweep_is_refused_in_sentences_or_stands():
    draw = random.Random(7)  # noqa: S311
    names = [f"{section}.{key}" if key else section for section, key in KEYS]
    said, refused = [], 0
    for _ in range(60):
        over = {name: draw.choice(SWEPT) for name in draw.sample([*names, "a.b", ""], 2)}
        one = {"over": over, "realizations": draw.choice(WHOLE), "base": draw.choice(ODD)}
        try:
            study = ingest.check(copy.deepcopy(PAPER) | {"sweeps": {"one": one}})
            sweep.studies(study, "one")
        except ConfigurationError as error:
            refused += 1
            said += str(error).split("\n")
    assert refused > 40
    assert all(sentence.isprintable() for sentence in said)
