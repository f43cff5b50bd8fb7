"""Every command that the pages show is one that ./run takes."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest
import yte

from vinsar.__main__ import parser

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMAND = re.compile(r"^    (?:cd \S+ && )?\./run(?!\S)(.*)$", re.MULTILINE)
HERE_DOCUMENT = re.compile(r"^    cat > (\S+) <<END\n(.*?)^    END$", re.MULTILINE | re.DOTALL)
LISTED = [
    (page, found[1].partition(" #")[0].strip())
    for page in PAGES
    for found in COMMAND.finditer(page.read_text(encoding="utf-8"))
]
OURS = re.search(r"VINSAR = \((.*?)\)", (ROOT / "run").read_text(), re.DOTALL)[1]


@pytest.fixture(scope="module")
def start():
    spec = importlib.util.spec_from_file_location("start", ROOT / "workflow/start.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def place(new_checkout):
    """A checkout with the files that the pages show how to write."""
    made = new_checkout()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name, content in HERE_DOCUMENT.findall(text):
            lines = [line.removeprefix("    ") for line in content.splitlines()]
            (made.folder / name).write_text("\n".join(lines) + "\n")
        for name, content in re.findall(r"^    # (config/\S+\.yaml)\n((?:    .*\n)+)", text, re.M):
            lines = [line.removeprefix("    ") for line in content.splitlines()]
            (made.folder / name).write_text("\n".join(lines) + "\n")
    return made.folder


def test_commands_are_found():
    assert len(LISTED) > 25


@pytest.mark.parametrize(
    "command", [command for _, command in LISTED], ids=[page.stem for page, _ in LISTED]
)
def test_a_command_of_the_pages_is_taken(start, place, monkeypatch, command):
    monkeypatch.chdir(place)
    # Square brackets stand for what may be left out, FILE and FOLDER for any.
    arguments = shlex.split(re.sub(r"[\[\]]", "", command))
    name = arguments[0] if arguments else ""
    if name in ("test", "benchmarks"):
        return
    if f'"{name}"' in OURS:
        parser().parse_args(arguments)
        return
    taken = []
    monkeypatch.setattr(yte, "process_yaml", yte.process_yaml)
    monkeypatch.setattr(start.cli, "args_to_api", lambda options, _: taken.append(options))
    monkeypatch.setattr(start, "suit_cluster", lambda _: None)
    monkeypatch.setattr(start, "quote_interpreter", lambda: None)
    monkeypatch.setattr(start, "fork_jobs", lambda: None)
    monkeypatch.setattr(start, "follow_workflows", list)
    start.main(arguments)
    (options,) = taken
    files = [ROOT / "Snakefile", *(ROOT / "workflow/rules").glob("*.smk")]
    rules = "".join(path.read_text() for path in files)
    for target in options.targets:
        assert target.startswith("results/") or f"rule {target}:" in rules, target
    assert all(path.is_file() for path in options.configfile)
