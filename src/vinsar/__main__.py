"""The commands that ask results: ``trace``, ``verify``, ``diff``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vinsar import config, lineage, validation


def _study(name: str, files: list[str]) -> config.Study | None:
    """Return the configuration as it is now, or nothing where it is not known."""
    own = Path("config") / f"{name}.yaml"
    paths = [Path("config/paper.yaml"), *([own] if own.stem != "paper" else [])]
    if files:
        return validation.load(paths[0], *files)
    if not all(path.is_file() for path in paths):
        return None
    return validation.load(*paths)


def _trace(arguments: argparse.Namespace) -> int:
    name = lineage.trace(arguments.file).attributes.get("vinsar_study", "")
    study = _study(name, arguments.configfile)
    sys.stdout.write(lineage.as_text(lineage.trace(arguments.file, study)))
    if study is None:
        sys.stdout.write(_unknown(name))
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    folder = Path(arguments.folder)
    study = _study(folder.name, arguments.configfile)
    found = lineage.verify(folder, study)
    for name, problems in sorted(found.items()):
        for problem in problems:
            sys.stdout.write(f"{name}: {problem}\n")
    sound = sum(not problems for problems in found.values())
    sys.stdout.write(f"{sound} of {len(found)} results unchanged\n")
    if study is None:
        sys.stdout.write(_unknown(folder.name))
    return int(lineage.troubled(found))


def _unknown(name: str) -> str:
    return f"The configuration was not compared: config/{name}.yaml is not there (--configfile).\n"


def _diff(arguments: argparse.Namespace) -> int:
    lines = lineage.compare(arguments.first, arguments.second)
    sys.stdout.write("".join(f"{line}\n" for line in lines) or "no difference\n")
    return int(bool(lines))


def main() -> int:
    """Answer a command; return the exit code."""
    parser = argparse.ArgumentParser(prog="./run", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="command")
    trace = commands.add_parser("trace", help="what a result comes from, and what has changed")
    trace.add_argument("file")
    trace.set_defaults(answer=_trace)
    verify = commands.add_parser("verify", help="check all results of a study")
    verify.add_argument("folder")
    verify.set_defaults(answer=_verify)
    for parser_ in (trace, verify):
        parser_.add_argument(
            "--configfile",
            nargs="+",
            default=[],
            help="what the study was run with, if not its own",
        )
    diff = commands.add_parser("diff", help="what differs between two studies")
    diff.add_argument("first")
    diff.add_argument("second")
    diff.set_defaults(answer=_diff)
    arguments = parser.parse_args()
    try:
        return int(arguments.answer(arguments))
    except (ValueError, OSError) as error:
        sys.stderr.write(f"vinsar: {error}\n")
        return 2


if __name__ == "__main__":
    sys.exit(main())
