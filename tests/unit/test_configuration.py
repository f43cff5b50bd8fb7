import json
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ValidationError

from vinsar.foundations.configuration import Study, swept_section
from vinsar.study.composition import StudyModel

CONFIG = Path(__file__).parents[2] / "config"


def paper() -> dict:
    return yaml.safe_load((CONFIG / "paper.yaml").read_text())


def fields(model: type[BaseModel], prefix: str = ""):
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from fields(field.annotation, f"{prefix}{name}.")
            if field.description is None:
                continue
        yield prefix + name, field


def test_paper_yaml_holds_table_1():
    radar = StudyModel.model_validate(paper()).radar
    assert (radar.start_frequency_hz, radar.stop_frequency_hz) == (13e9, 15e9)
    assert (radar.aperture_length_m, radar.position_spacing_m) == (0.8, 0.01)
    assert (radar.baseline_m, radar.baseline_angle_deg) == (0.3, 90)


@pytest.mark.parametrize("section", [name for name in paper() if name not in {"study", "seed"}])
def test_models_hold_no_defaults_so_a_missing_section_is_refused(section):
    raw = paper()
    del raw[section]
    with pytest.raises(ValidationError, match=section):
        StudyModel.model_validate(raw)


def test_every_key_has_a_description_and_its_place_in_the_paper():
    for name, field in fields(Study):
        assert field.description, name
        assert field.json_schema_extra["paper"], name


def test_a_part_of_a_study_has_nothing_else():
    part = StudyModel.part({"seed": 7, "radar": paper()["radar"]})
    assert part.seed == 7
    assert part.radar.baseline_m == 0.3
    with pytest.raises(AttributeError):
        _ = part.scene


def test_a_study_never_changes():
    study = StudyModel.model_validate(paper())
    with pytest.raises(ValidationError, match="frozen"):
        study.radar.baseline_m = 1.0


def test_a_part_with_sweeps_comes_back_from_plain_values():
    study = StudyModel.model_validate(paper())
    plain = study.values(["sweeps", "seed", "radar.baseline_m"])
    assert json.loads(json.dumps(plain)) == plain
    part = StudyModel.part(plain)
    assert part.sweeps == study.sweeps
    assert part.seed == study.seed
    assert part.radar.baseline_m == study.radar.baseline_m


def test_a_section_of_a_sweep_has_its_base_s_overrides():
    study = StudyModel.model_validate(paper())
    assert study.imaging.grid_spacing_m == 0.02
    assert swept_section(study, "snr", "imaging").grid_spacing_m == 0.05
    assert swept_section(study, "snr", "radar") == study.radar
