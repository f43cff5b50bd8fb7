"""The report: what it says is what the study holds, and what a study lacks is left out."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from vinsar import figures, report
from vinsar.figures.drawing import style
from vinsar.foundations import tables, variables
from vinsar.foundations.configuration import Study
from vinsar.report import content
from vinsar.results import lineage
from vinsar.study.composition import StudyModel

ROOT = Path(__file__).parents[2]
PAPER = yaml.safe_load((ROOT / "config/paper.yaml").read_text(encoding="utf-8"))
CLAIM = {
    "id": "F4-std",
    "where": "2.3",
    "paper": "error spread about 4.5 cm",
    "ours": "2.1 cm <script>alert(1)</script> & more",
    "criterion": "reproduced if within a tenth",
    "verdict": "partly",
}
RECORD: dict[str, Any] = {
    "rule": "dem",
    "seconds": 1.25,
    "started": "2026-01-01T00:00:00+00:00",
    "bytes": 2_000_000,
    "sha256": "ab" * 32,
    "python": "3.11.1",
    "platform": "Linux",
    "provenance": {
        "source": "vinsar 0.1.0",
        "vinsar_commit": "0123456789ab",
        "vinsar_stage": "dem",
        "vinsar_libraries": json.dumps({"numpy": "2.4.6"}),
        "vinsar_code": json.dumps({"src/vinsar/height.py": "cd" * 32}),
    },
}


def make_study(**sections: Any) -> Study:
    values = {
        name: section | sections.get(name, {}) if isinstance(section, dict) else section
        for name, section in PAPER.items()
    }
    return StudyModel.model_validate(values)


def sources(study: Study | None = None, **parts: Any) -> report.Sources:
    given: dict[str, Any] = {
        "study": study or make_study(),
        "paper": PAPER,
        "products": {},
        "figures": (),
        "records": {},
    }
    return report.Sources(**given | parts)


def section(found: report.Report, name: str) -> content.Section:
    return next(section for section in found.sections if section.name == name)


def table(found: report.Report, name: str) -> content.Table:
    blocks = [block for part in found.sections for block in part.blocks]
    return next(b for b in blocks if isinstance(b, content.Table) and b.name == name)


@pytest.fixture(scope="module")
def accuracy() -> Any:
    error = np.array([[0.01, -0.02], [0.2, np.nan]])
    data: dict[str, Any] = {
        "height_error": error,
        "shadow": np.array([[False, False], [True, False]]),
        "delivered": np.array([[True, True], [False, False]]),
        "tolerance": 0.05,
    }
    for number, name in enumerate(variables.PRODUCTS["accuracy"]):
        if name not in data:
            data[name] = np.array([0.01, 0.02, 0.03, 0.005]) * (number + 1)
    data["cell_count"] = np.array([4, 3, 1, 3])
    data["binned_std"] = data["binned_error"] = 0.01 * np.arange(5)
    data["binned_coverage"] = np.full((5, 2), 0.7)
    data["hidden_delivered"], data["visible_withheld"] = 0.01, 0.04
    axis = np.array([0.0, 0.1])
    regions = np.array(["whole_scene", "visible_ground", "shadow", "delivered"])
    return variables.dataset("accuracy", data, {"x": axis, "y": axis, "region": regions})


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """Files of two figures that are not drawn from any product."""
    folder = tmp_path_factory.mktemp("figures")
    paths = []
    for name, width in (("fig1", 180), ("snr", 88)):
        figure = style.new_figure(width, 50)
        style.place(figure, 10, 10, 30, 30)
        made = [folder / f"{name}.{suffix}" for suffix in ("pdf", "png")]
        figures.save(figure, made, png_dpi=PAPER["figures"]["png_dpi"])
        paths += made
    return tuple(paths)


def test_a_study_without_results_reports_its_radar_alone() -> None:
    found = report.build(sources())
    assert [part.name for part in found.sections] == ["radar"]


def test_measured_echoes_are_reported_without_the_scene_that_they_do_not_have() -> None:
    study = make_study(measurement={"file": "echo.nc"}, imaging={"y_min_m": 20.0, "y_max_m": 24.0})
    found = report.build(sources(study))
    assert found.subtitle.startswith("From measured echoes")
    text = next(b for b in section(found, "radar").blocks[1:] if isinstance(b, content.Text))
    assert "in the middle of the image at x = 0 m, y = 22 m" in text.text
    shown = {name: value for name, value, _ in content.quantities(study)}
    assert shown["slant range of the lower channel"] == f"{np.hypot(22, 2):.3f}"


def test_derived_quantities_are_those_of_the_exact_geometry_and_of_the_paper_s_equations() -> None:
    shown = {name: value for name, value, _ in content.quantities(make_study())}
    c, r1, r2 = 299_792_458.0, np.hypot(13.0, 2.0), np.hypot(13.0, 2.3)
    wavelength, cell = c / 14e9, c / 4e9
    # 13 GHz of the one channel and 15 GHz of the other see the same wavenumber of the ground.
    critical = np.sqrt((15 / 13 * r1) ** 2 - 13**2) - 2
    expected = {
        "wavelength of the carrier, λ": 1000 * wavelength,
        "frequency step": 5,
        "unambiguous range": c / 10e6,
        "antenna positions": 81,
        "slant-range resolution": 100 * cell,
        "resolution on the ground in x": 100 * wavelength * r1 / 1.6,
        "resolution on the ground in y": 100 * cell * r1 / 13,
        "slant range of the lower channel": r1,
        "its look angle from nadir, θ": np.degrees(np.arctan2(13, 2)),
        "critical baseline of this attitude": critical,
        "a quarter of it, the rule of thumb": critical / 4,
        "coherence of level ground": (15 / r2 - 13 / r1) / (2 / np.sqrt(r1 * r2)),
        "height of ambiguity": wavelength * r2 / 0.6,
        "spread of the height if the phase is random": 100 * wavelength * r2 / 0.6 / 12**0.5,
        "baseline across the line of sight, B⊥ (Eq. 4)": 0.3 * 13 / r1,
        "critical B⊥ of a plane wave": wavelength * r1 * (13 / 2) / (2 * cell),
    }
    assert set(shown) == set(expected)
    for name, value in expected.items():
        # As written, within half of the last digit.
        digits = len(shown[name].partition(".")[2])
        assert float(shown[name]) == pytest.approx(value, abs=0.52 * 10**-digits), name


@pytest.mark.parametrize(
    ("key", "value", "written"),
    [
        ("start_frequency_hz", 13e9, "13 GHz"),
        ("spacing_hz", 5e6, "5 MHz"),
        ("baseline_m", -0.3, "−0.3 m"),
        ("baseline_angle_deg", 90.0, "90°"),
        ("snr_db", None, "none"),
        ("dwell_s", 1e-6, "1 µs"),
        ("objects", (), "none"),
        ("objects", ({"x_m": 1.0, "on": True}, {"x_m": -2.0}), "x_m 1, on yes; x_m −2"),
        ("occlusion", True, "yes"),
        ("system", "rail", "rail"),
    ],
)
def test_values_are_written_with_the_unit_of_their_key(key: str, value: Any, written: str) -> None:
    assert content.with_unit(key, value) == written


def test_what_a_study_changes_is_listed_and_no_more() -> None:
    study = make_study(radar={"baseline_m": 0.5}, figures={"png_dpi": 300})
    found = table(report.build(sources(study)), "changes")
    assert found.rows == (("`radar.baseline_m`", "0.3 m", "0.5 m"),)


def test_errata_of_the_documentation_are_read_whole() -> None:
    text = (ROOT / "docs/errata.md").read_text(encoding="utf-8")
    rows = tables.read(text)
    assert {len(row) for row in rows} == {4}
    assert len(rows) == sum(line.startswith("|") for line in text.splitlines()) - 1


def test_accuracy_claims_and_provenance_say_what_they_were_given(accuracy: Any) -> None:
    found = report.build(
        sources(
            products={"accuracy": accuracy},
            claims=(CLAIM,),
            errata="| equation | right |\n|---|---|\n| Eq. 3 | 4 |\n",
            records={"dem.nc": RECORD},
        )
    )
    names = [part.name for part in found.sections]
    assert names == [
        "summary", "radar", "chain", "accuracy", "claims", "errata", "times", "provenance",
    ]  # fmt: skip
    assert [row[:2] for row in table(found, "accuracy").rows] == [
        ("delivered", "3"),
        ("whole scene", "4"),
        ("visible ground", "3"),
        ("shadow", "1"),
    ]
    assert table(found, "claims").rows[0][-1] == "partly"
    assert table(found, "errata").rows == (("Eq. 3", "4"),)
    assert table(found, "times").rows[0][:3] == ("dem", "1.25", "100.0")
    assert table(found, "digests").rows == (("dem.nc", "ab" * 32),)
    code = next(b for b in section(found, "provenance").blocks if isinstance(b, content.Code))
    assert code.text.splitlines()[0] == "git checkout 0123456789ab"


def test_a_stage_without_a_small_picture_is_named(
    accuracy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for thumbnails in ({}, {"accuracy": figures.Thumbnail("height error")}):
        monkeypatch.setattr(content, "THUMBNAILS", thumbnails)
        found = report.build(sources(products={"accuracy": accuracy}))
        (step,) = section(found, "chain").blocks[1].steps  # type: ignore[union-attr]
        assert step.png is None
        assert step.shows == ("height error" if thumbnails else "accuracy")


def test_pictures_keep_their_width_and_panels_of_a_sheet_are_left_out(
    drawn: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = replace(figures.FIGURES["fig1"], caption="The\n``geometry``.\n")
    monkeypatch.setitem(figures.FIGURES, "fig1", shown)
    for name in ("fig3", "fig3a"):
        (tmp_path / f"{name}.png").write_bytes(drawn[1].read_bytes())
    given = (*drawn, tmp_path / "fig3.png", tmp_path / "fig3a.png")
    found = report.build(sources(figures=given))
    pictures = [b for b in section(found, "figures").blocks if isinstance(b, content.Picture)]
    assert [(p.name, p.share, p.pdf is None) for p in pictures] == [
        ("fig1", 1.0, False),
        ("snr", 0.55, False),
        ("fig3", 1.0, True),
    ]
    assert pictures[0].label == "Figure 1. Geometry."
    assert pictures[0].caption.startswith("The `geometry`. Drawn for a target 13 m ahead")
    # Its sweep is not there, so it has no numbers, and it is shown all the same.
    assert pictures[1].caption == figures.FIGURES["snr"].caption


def test_both_renderings_escape_hold_their_provenance_and_are_the_same_twice(
    accuracy: Any, drawn: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    caption = "Code in `a_long.name`, #hash $x$ *star* _under_ <b>."
    shown = replace(figures.FIGURES["fig1"], caption=caption)
    monkeypatch.setitem(figures.FIGURES, "fig1", shown)
    found = report.build(
        sources(
            products={"accuracy": accuracy},
            claims=(CLAIM,),
            figures=drawn,
            records={"dem.nc": RECORD},
        )
    )
    origin = {"vinsar_stage": "report", "x": 'a (b) "</script>" \\ ü <!--<script '}
    page, pdf = report.as_html(found, origin), report.as_pdf(found, origin)
    assert page == report.as_html(found, origin)
    assert pdf == report.as_pdf(found, origin)
    assert "<script>alert" not in page
    assert page.count("<script") == page.count("</script") == 1
    assert "<!--" not in page
    assert html.escape(CLAIM["ours"], quote=False) in page
    assert "<code>a_long.name</code>, #hash $x$ *star* _under_ &lt;b&gt;" in page
    assert not re.search(r"""(src|href)=["'](?!data:image/png;base64,|#)""", page)
    assert page.count("<img ") == 3  # two figures and the stage accuracy
    for name, data in (("report.html", page.encode()), ("report.pdf", pdf)):
        path = tmp_path / name
        path.write_bytes(data)
        assert lineage.read_provenance(path) == origin
    assert b"/CreationDate" not in pdf
    # What a figure's PDF carries of its own does not reach the report's.
    assert pdf.count(b"/Keywords") == 1
