"""Print docs/reliability.md: each kind of trouble, the cases tried, and what happened.

.venv/bin/python tests/reliability.py > docs/reliability.md
"""

import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).parents[1]
UNIT, WORKFLOW = "tests/unit", "tests/workflow"
# What goes wrong, what is to happen, and the tests that try it.
KINDS = {
    "another user reaches a sweep's workers": (
        "nothing listens, nothing can be opened",
        [f"{UNIT}/test_cluster.py::test_nobody_can_speak_to_the_workers",
         f"{UNIT}/test_cluster.py::test_another_user_cannot_open_the_workers_pipes"],
    ),
    "a configuration that runs code": (
        "refused before Snakemake reads it",
        [f"{WORKFLOW}/test_start.py::test_no_way_of_giving_a_configuration_runs_code",
         f"{UNIT}/test_strict_yaml.py::test_a_file_that_asks_to_be_run_is_refused"],
    ),
    "a crate of foreign files and links": (
        "refused, and nothing is written through a link",
        [f"{UNIT}/test_crate.py"],
    ),
    "names and attributes that act": (
        "refused or written out",
        [f"{UNIT}/test_text.py",
         f"{UNIT}/test_validation.py::test_a_fault_names_its_key_and_what_is_allowed"],
    ),
    "keys twice, YAML 1.1 against 1.2, encodings, syntax": (
        "one sentence with file, line and column",
        [f"{UNIT}/test_strict_yaml.py"],
    ),
    "a study file that would overwrite the paper's": (
        "refused",
        [f"{WORKFLOW}/test_start.py::test_a_wrong_file_is_one_sentence",
         f"{WORKFLOW}/test_start.py::test_a_value_alone_does_not_change_the_paper_s_study"],
    ),
    "lines of checkpoints cut, flipped, foreign": (
        "dropped, named, computed again",
        [f"{UNIT}/test_checkpoint.py"],
    ),
    "a commit of another repository": (
        "not told",
        [f"{UNIT}/test_provenance.py"],
    ),
    "labels of sweeps that lie, wrong sweeps": (
        "refused",
        [f"{UNIT}/test_sweep.py::test_what_is_wrong_is_said_before_anything_runs"],
    ),
    "360 configurations and 60 sweeps of random values": (
        "refused in sentences or allowed; below 1 GB",
        [f"{UNIT}/test_bad_configurations.py"],
    ),
    "nonsense that is allowed": (
        "a warning of its own",
        [f"{UNIT}/test_validation.py::test_nonsense_that_is_allowed_has_a_word_of_its_own"],
    ),
    "files cut, full disks": (
        "a sentence with the file's name; the old file stays",
        [f"{UNIT}/test_storage.py"],
    ),
    "set-up: settings of pip's, environments, interruptions": (
        "made, or one sentence",
        [f"{WORKFLOW}/test_launcher.py"],
    ),
    "every command of the pages, options in any order": (
        "taken",
        [f"{WORKFLOW}/test_commands.py",
         f"{WORKFLOW}/test_start.py::test_targets_may_stand_behind_a_configuration"],
    ),
}  # fmt: skip
BEYOND = """\
Beyond these, `tests/workflow` spoils finished studies (edited products and records, lost intermediates, code that
changes while a job runs) and runs in folders of odd names; `tests/cluster` runs a study and a sweep on a SLURM of one
node.
"""  # noqa: E501


def main() -> int:
    """Run the tests of all kinds and print the table."""
    wanted = list(dict.fromkeys(test for _, tests in KINDS.values() for test in tests))
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        done = subprocess.run(
            [sys.executable, "-m", "pytest", f"--junitxml={report}", *wanted],
            cwd=ROOT, stdout=sys.stderr, check=False,
        )  # fmt: skip
        cases = list(ET.parse(report).iter("testcase"))  # noqa: S314
    lines = [
        "# Reliability",
        "",
        "What may go wrong, tried. `.venv/bin/python tests/reliability.py > docs/reliability.md` "
        "runs the tests and prints",
        "this page; a case is a test, and one with `hypothesis` tries 60 examples.",
        "",
        "| kind | what is to happen | cases | as it is to be |",
        "|---|---|---:|---:|",
    ]
    for kind, (expected, tests) in KINDS.items():
        mine = [case for case in cases if any(belongs(case, test) for test in tests)]
        tried = [case for case in mine if case.find("skipped") is None]
        good = [c for c in tried if c.find("failure") is None and c.find("error") is None]
        lines.append(f"| {kind} | {expected} | {len(tried)} | {len(good)} |")
    sys.stdout.write("\n".join([*lines, "", BEYOND]))
    return done.returncode


def belongs(case: ET.Element, test: str) -> bool:
    """Tell whether a case is one of a test's, or of a file's."""
    path, _, name = test.partition("::")
    module = path.removesuffix(".py").replace("/", ".")
    return case.get("classname") == module and (
        not name or case.get("name", "").partition("[")[0] == name
    )


if __name__ == "__main__":
    sys.exit(main())
