import copy
import json
from pathlib import Path

import yaml

from vinsar.study import reference

CONFIG = Path(__file__).parents[2] / "config"
PAPER = yaml.safe_load((CONFIG / "paper.yaml").read_text())
REMEDY = "write it again with `.venv/bin/python -m vinsar.study.reference config`"


def test_the_reference_page_is_in_step_with_the_models():
    assert (CONFIG / "README.md").read_text() == reference.markdown(PAPER), REMEDY


def test_the_page_shows_the_papers_value_of_every_key():
    page = reference.markdown(PAPER)
    assert "| `baseline_m` | `0.3` | number > 0 |" in page
    other = copy.deepcopy(PAPER)
    other["radar"]["baseline_m"] = 0.25
    assert "| `baseline_m` | `0.25` | number > 0 |" in reference.markdown(other)


def test_the_schema_requires_nothing_and_knows_every_section():
    schema = json.loads(reference.schema())
    assert "required" not in json.dumps(schema)
    assert set(schema["properties"]) == set(PAPER)
    assert schema["additionalProperties"] is False
