"""./run design, in a checkout where nothing has run."""

from pathlib import Path

import vinsar
from vinsar.prediction import design

ROOT = Path(__file__).parents[2]


def test_the_design_sheet_is_printed_kept_and_drawn_without_running_the_study(new_checkout):
    made = new_checkout()
    done = made.ask("design", "--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    study = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    sheet = design.as_markdown(design.Sheet(study))
    assert done.stdout.startswith(sheet)
    assert (made.results / "design.md").read_text() == sheet
    drawn = {path.name for path in (made.results / "figures").iterdir()}
    assert drawn == {f"design.{end}" for end in ("pdf", "svg", "png")}
    assert not list(made.results.glob("*.nc"))


def test_a_wrong_configuration_has_no_sheet(new_checkout):
    made = new_checkout()
    (made.folder / "wrong.yaml").write_text("study: wrong\nradar: {baseline_m: -1.0}\n")
    done = made.ask("design", "--configfile", "wrong.yaml")
    assert done.returncode == 2
    assert "radar.baseline_m = -1.0" in done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
    assert not made.results.exists()
