"""What holds for every figure: readable, as declared, and the same bytes each time."""

from __future__ import annotations

import hashlib
import re
import struct
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import matplotlib
import numpy as np
import pytest

from vinsar import figures
from vinsar.figures.drawing import style, thumbnails
from vinsar.foundations.errors import ConfigurationError
from vinsar.study import pipeline, validation
from vinsar.study.composition import StudyModel

PAPER = Path(__file__).parents[3] / "config" / "paper.yaml"
NAMES = list(figures.FIGURES)
# What is drawn by code of its own: the panels of a sheet are drawn like the sheet.
SHEETS = [name for name in NAMES if not figures.FIGURES[name].sheet]
OF_SWEEPS = [name for name in NAMES if figures.FIGURES[name].sweeps]
# Half as wide as the others: the panels of the chain's sheet, and what shows one curve.
NARROW = {*(f"fig3{letter}" for letter in "abcdefgh"), "snr", "design_check"}
# The front sheet is a slide, whatever the journal's columns and text are.
SLIDES = {"summary": 338.7}


def test_every_module_of_the_folder_declares_figures_that_read_what_there_is(study):
    folder = Path(figures.__file__).parent
    modules = {f"figures.{path.stem}" for path in folder.glob("*.py") if path.stem != "__init__"}
    assert set(figures.MODULES.values()) == modules
    assert set(figures.MODULES) == set(NAMES)
    for figure in figures.FIGURES.values():
        assert set(figure.inputs) <= set(pipeline.STAGES)
        assert set(figure.sweeps) <= set(study.sweeps)
        assert set(figure.sections) <= set(StudyModel.model_fields)
        assert "figures" in figure.sections
        assert figure.title
        assert figure.caption.endswith(".")
        assert figure.sheet in {"", *NAMES}


def test_a_name_that_two_modules_declare_is_refused():
    modules = [ModuleType(name) for name in ("one", "two")]
    for module in modules:
        module.FIGURES = {"fig1": figures.FIGURES["fig1"]}
    with pytest.raises(ValueError, match="'fig1' is declared twice in FIGURES: one and two"):
        figures._declared(modules, "FIGURES")


@pytest.mark.parametrize("name", NAMES)
def test_figure_is_readable_and_takes_what_it_declares(usual, check_readable, name):
    figure = usual(name)
    width, height = figure.get_size_inches() * style.MM_PER_INCH
    assert width == pytest.approx(SLIDES.get(name, 88 if name in NARROW else 180))
    assert height < 247  # fits on a page of A4 with its caption
    check_readable(figure)


@pytest.mark.parametrize(
    "look",
    [
        {"font_size_pt": 8.0},
        {"one_column_mm": 83.0, "two_columns_mm": 170.0, "font_size_pt": 7.0, "font": "serif"},
    ],
    ids=["large", "narrow"],
)
@pytest.mark.parametrize("name", NAMES)
def test_figure_has_the_width_and_the_text_asked_for_and_stays_readable(
    make_study, draw, usual, check_readable, drawn_texts, sizes, products, study, name, look
):
    asked = study.model_copy(update={"figures": study.figures.model_copy(update=look)})
    validation.check(make_study(figures=look).model_dump(mode="json"))
    before, figure = usual(name), draw(name, products, asked)
    shape = before.get_figheight() / before.get_figwidth()
    width = asked.figures.one_column_mm if name in NARROW else asked.figures.two_columns_mm
    scale = asked.figures.font_size_pt / study.figures.font_size_pt
    if name in SLIDES:
        width, scale = SLIDES[name], 1.0
    assert figure.get_size_inches() * 25.4 == pytest.approx([width, shape * width])
    check_readable(figure)
    expected = [round(size * scale, 3) for size in sizes(before)]
    assert sizes(figure) == pytest.approx(expected, abs=0.002)
    fonts = {text.get_fontname() for text in drawn_texts(figure)}
    assert fonts == {"STIXGeneral" if asked.figures.font == "serif" else "DejaVu Sans"}


@pytest.mark.parametrize("name", [name for name in NAMES if figures.FIGURES[name].numbers])
def test_numbers_of_a_caption_are_a_sentence_without_gaps(products, study, name):
    text = figures.FIGURES[name].numbers(products, study)
    assert text.endswith(".")
    assert "nan" not in text


@pytest.mark.parametrize("name", OF_SWEEPS)
def test_failed_cases_leave_gaps_and_no_exception(draw, check_readable, products, study, name):
    key = f"sweeps/{figures.FIGURES[name].sweeps[0]}"
    broken = products[key].copy(deep=True)
    broken["std"][..., 0, :] = np.nan
    last = next(dim for dim in reversed(broken["std"].dims[:-2]) if dim != "realization")
    broken["std"].loc[{last: broken[last][-1]}] = np.nan
    check_readable(draw(name, products | {key: broken}, study))


@pytest.mark.parametrize("name", ["fig5", "baseline_length", "snr"])
def test_curves_differ_without_their_colours(usual, name):
    axes = usual(name).axes[0]
    marked = [line for line in axes.lines if line.get_marker() not in {"None", "*"}]
    assert len(marked) == 3
    assert len({line.get_marker() for line in marked}) == 3
    assert len({line.get_linestyle() + str(line._dash_pattern) for line in marked}) == 3


@pytest.mark.parametrize("name", SHEETS)
def test_files_are_the_same_bytes_each_time_with_fonts_and_without_dates(
    draw, usual, save_all, png_chunks, pdf_content, products, study, tmp_path, name
):
    made = []
    for number, figure in enumerate((usual(name), draw(name, products, study))):
        folder = tmp_path / str(number)
        folder.mkdir()
        made.append(save_all(figure, folder))
    assert made[0] == made[1]
    saved = made[0]

    pdf = pdf_content(saved["pdf"])
    assert re.search(rb"/BaseFont /[A-Z]{6}\+DejaVuSans", pdf)
    assert b"/CIDFontType2" in pdf
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    svg = saved["svg"].decode("utf-8")
    assert re.search(r"<text[^>]*>[^<]+</text>", svg)
    assert "DejaVu Sans" in svg
    assert {kind for kind, _ in png_chunks(saved["png"])} <= {"IHDR", "pHYs", "IDAT", "IEND"}
    assert b"/CreationDate" not in pdf
    assert b"/ModDate" not in pdf
    for data in (pdf, saved["svg"]):
        assert not re.search(rb"D:20\d\d|20\d\d-[01]\d-[0-3]\d", data)
        assert b"dc:date" not in data
        assert matplotlib.__version__.encode() not in data
    # Surfaces and maps are pixels in them: thousands of facets would be megabytes.
    assert len(saved["pdf"]) < 200_000
    assert len(saved["svg"]) < 300_000


DRAW_FIG1 = """
import hashlib, sys
from pathlib import Path
import yaml
import vinsar.figures
assert "matplotlib" not in sys.modules, "importing the figures is not light"
from vinsar.study.composition import StudyModel
study = StudyModel.model_validate(yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8")))
paths = [Path(sys.argv[2]) / f"fig1.{suffix}" for suffix in ("pdf", "svg", "png")]
figure = vinsar.figures.FIGURES["fig1"].draw({}, study)
vinsar.figures.save(figure, paths, png_dpi=100)
print(*(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths))
"""


def test_two_processes_give_the_same_bytes_whatever_the_user_s_settings(make_study, draw, tmp_path):
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", DRAW_FIG1, str(PAPER), str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    paths = [tmp_path / f"here.{suffix}" for suffix in ("pdf", "svg", "png")]
    with matplotlib.rc_context({"lines.linewidth": 7, "font.size": 20, "pdf.fonttype": 3}):
        before = dict(matplotlib.rcParams)
        figures.save(draw("fig1", {}, make_study()), paths, png_dpi=100)
        assert dict(matplotlib.rcParams) == before
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]
    assert result.stdout.split() == digests


@pytest.mark.parametrize("name", figures.THUMBNAILS)
def test_products_have_small_pictures_or_a_line(products, study, name):
    thumbnail = figures.THUMBNAILS[name]
    assert thumbnail.shows
    if name not in products:
        return
    made = thumbnails.png(thumbnail, products[name], study.figures)
    assert (made is None) == (thumbnail.draw is None)
    if made is not None:
        width, height = struct.unpack(">II", made[16:24])
        assert width > 250
        assert height > 200
        assert made == thumbnails.png(thumbnail, products[name], study.figures)


def test_figures_that_cannot_be_drawn_are_refused_before_anything_runs(make_study):
    asked = ["fig1", "fig9", "fig5", "fig1"]
    study = make_study(outputs={"figures": asked, "claims": False})
    study = study.model_copy(update={"sweeps": {}})
    with pytest.raises(ConfigurationError) as caught:
        figures.check(study, pipeline.STAGES)
    keys = [fault.key for fault in caught.value.faults]
    assert keys == [f"outputs.figures[{number}]" for number in (1, 2, 3)]
    assert "'vibration'" in caught.value.faults[1].allowed


def test_measured_echoes_have_the_figures_that_need_no_truth(make_study):
    study = make_study(
        measurement={"file": "echo.nc"},
        outputs={"figures": ["measured", "fig1", "fig4", "snr"], "claims": False},
    )
    known = {*pipeline.stages(study), *pipeline.from_files(study)}
    with pytest.raises(ConfigurationError) as caught:
        figures.check(study, known)
    assert [fault.value for fault in caught.value.faults] == ["fig1", "fig4", "snr"]
    for fault in caught.value.faults:
        there_are = fault.allowed.partition("there are ")[2].split(", ")
        assert {"measured", "fig2"} <= set(there_are)
