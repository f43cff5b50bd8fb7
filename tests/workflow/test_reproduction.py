"""A study run afresh, elsewhere and on another number of cores."""

import subprocess

from vinsar.study import pipeline

CONFIG = ("--configfile", "tiny.yaml")


# Each kind of figure is drawn twice in its unit test, and sweeps are run in every way in theirs.
KEPT = ("accuracy", "figures/fig4")


def test_the_same_study_elsewhere_and_on_another_number_of_cores_is_the_same_bytes(copy):
    kept = 0
    for record in (copy.results / "records").rglob("*.json"):
        name = record.relative_to(copy.results / "records").as_posix()
        if name.startswith((*KEPT, *pipeline.STAGES)):
            kept += 1
        else:
            record.unlink()
    done = copy.ask("reproduce", "results/tiny", *CONFIG, "--cores", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{kept} of {kept} results are the same bytes" in done.stdout
    assert done.stdout.endswith("then 1): reproduced\n")


def test_the_sources_are_those_of_the_commit_whatever_has_come_since(new_checkout, monkeypatch):
    made = new_checkout()
    for who in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{who}_NAME", "test")
        monkeypatch.setenv(f"GIT_{who}_EMAIL", "test@localhost")

    def commit():
        for arguments in (("add", "--all"), ("commit", "--quiet", "--message", "test")):
            subprocess.run(["git", *arguments], cwd=made.folder, check=True)

    (made.folder / ".gitignore").write_text("/results/\n/.snakemake/\n__pycache__/\n")
    subprocess.run(["git", "init", "--quiet"], cwd=made.folder, check=True)
    commit()
    # The antenna positions alone.
    done = made.snakemake("results/tiny/trajectory.nc")
    assert done.returncode == 0, done.stderr
    (made.folder / "workflow/scripts/stage.py").write_text("raise SystemExit('code of today')\n")
    commit()
    done = made.ask("reproduce", "results/tiny", *CONFIG)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == "1 of 1 results are the same bytes (cores: 1, then 2): reproduced\n"
