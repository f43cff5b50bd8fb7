"""The commands beside Snakemake: the design sheet, and what asks, repeats and packs results."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import vinsar
from vinsar import measure, results
from vinsar.foundations import text
from vinsar.foundations.configuration import Study
from vinsar.prediction import design
from vinsar.results import export, lineage, reproduction, workflow


def _say(what: str) -> None:
    """Write text, and nothing that a terminal obeys or cannot show."""
    shown = text.printable(what, lines=True)
    sys.stdout.write(text.fitting(shown, sys.stdout.encoding))
    sys.stdout.flush()


def _study(name: str, files: list[str]) -> Study | None:
    """Return the configuration as it is now, or nothing where it is not known."""
    own = Path("config") / f"{name}.yaml"
    if files:
        return vinsar.load(*files)
    if not own.is_file():
        return None
    return vinsar.load(own)


def _trace(arguments: argparse.Namespace) -> int:
    name = lineage.trace(arguments.file).attributes.get("vinsar_study", "")
    study = _study(name, arguments.configfile)
    _say(lineage.as_text(lineage.trace(arguments.file, study)))
    if study is None:
        _say(_unknown(name))
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    folder = Path(arguments.folder)
    study = _study(folder.name, arguments.configfile)
    found = lineage.verify(folder, study)
    for name, problems in sorted(found.items()):
        for problem in problems:
            _say(f"{name}: {problem}\n")
    sound = sum(not problems for problems in found.values())
    _say(f"{sound} of {len(found)} results unchanged\n")
    if study is None:
        _say(_unknown(folder.name))
    return int(lineage.troubled(found))


def _unknown(name: str) -> str:
    return f"The configuration was not compared: config/{name}.yaml is not there (--configfile).\n"


def _diff(arguments: argparse.Namespace) -> int:
    lines = lineage.compare(arguments.first, arguments.second)
    _say("".join(f"{line}\n" for line in lines) or "no difference\n")
    return int(bool(lines))


def _design(arguments: argparse.Namespace) -> int:
    study = vinsar.load(*arguments.configfile)
    _say(design.as_markdown(design.Sheet(study)))
    # The workflow keeps the sheet and draws it.
    workflow.make(["design", "figure_design"], arguments.configfile)
    folder, ends = results.folder(study.study).as_posix(), ", ".join(study.figures.formats)
    _say(f"\nKept as {folder}/design.md, drawn as {folder}/figures/design ({ends}).\n")
    return 0


def _reproduce(arguments: argparse.Namespace) -> int:
    name = Path(arguments.folder).name
    _known_study(name, arguments.configfile)
    own = [f"config/{name}.yaml"] if name != "paper" else []
    verdict = reproduction.reproduce(
        arguments.folder, configuration=arguments.configfile or own, cores=arguments.cores
    )
    for different in verdict.differing:
        _say(f"{different}: not the same bytes\n")
    _say("".join(f"{reason}\n" for reason in verdict.reasons))
    total, same = len(verdict.compared), len(verdict.compared) - len(verdict.differing)
    before, now = verdict.cores
    _say(
        f"{same} of {total} results are the same bytes (cores: {before}, then {now}): "
        f"{'reproduced' if same == total else 'NOT reproduced'}\n"
    )
    if verdict.kept is not None:
        _say(f"The fresh run is in {verdict.kept}\n")
    return int(same != total)


def _crate(arguments: argparse.Namespace) -> int:
    from vinsar.results import crate

    study = _known_study(Path(arguments.folder).name, arguments.configfile)
    archive = crate.write(arguments.folder, study, agent=arguments.agent)
    _say(f"{arguments.folder} is an RO-Crate now; packed: {archive}\n")
    return 0


def _known_study(name: str, files: list[str]) -> Study:
    study = _study(name, files)
    if study is None:
        raise ValueError(f"config/{name}.yaml is not there; name the study's with --configfile")
    return study


def _schema(arguments: argparse.Namespace) -> int:
    del arguments
    from vinsar.study import reference

    sys.stdout.write(reference.schema())
    return 0


def _export(arguments: argparse.Namespace) -> int:
    export.measurement(arguments.folder, arguments.file)
    return 0


def parser() -> argparse.ArgumentParser:
    """Return what reads the commands."""
    parser = argparse.ArgumentParser(prog="./run", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="command")
    trace = commands.add_parser("trace", help="what a result comes from, and what has changed")
    trace.add_argument("file")
    trace.set_defaults(answer=_trace)
    verify = commands.add_parser("verify", help="check all results of a study")
    verify.add_argument("folder")
    verify.set_defaults(answer=_verify)
    again = commands.add_parser("reproduce", help="run a study afresh and compare every byte")
    again.add_argument("folder")
    again.add_argument("--cores", type=int, help="cores of the fresh run, if not one less")
    again.set_defaults(answer=_reproduce)
    packed = commands.add_parser("crate", help="make an RO-Crate of a finished study")
    packed.add_argument("folder")
    packed.add_argument("--agent", default="", help="name of the person who ran the study")
    packed.set_defaults(answer=_crate)
    sheet = commands.add_parser("design", help="what a configuration will do, without running it")
    sheet.set_defaults(answer=_design)
    for subparser in (trace, verify, again, packed, sheet):
        subparser.add_argument(
            "--configfile",
            nargs="+",
            default=[],
            help="files that the study is configured with, if not its own",
        )
    diff = commands.add_parser("diff", help="what differs between two studies")
    diff.add_argument("first")
    diff.add_argument("second")
    diff.set_defaults(answer=_diff)
    export = commands.add_parser("export", help="write a study's echo as a measurement")
    export.add_argument("folder")
    export.add_argument("file")
    export.set_defaults(answer=_export)
    measure.add_commands(commands)
    schema = commands.add_parser("schema", help="print the JSON schema of a study's file")
    schema.set_defaults(answer=_schema)
    return parser


def main() -> int:
    """Answer a command; return the exit code."""
    arguments = parser().parse_args()
    try:
        return int(arguments.answer(arguments))
    except (ValueError, OSError) as error:
        shown = text.printable(f"vinsar: {error}\n", lines=True)
        sys.stderr.write(text.fitting(shown, sys.stderr.encoding))
        return 2


if __name__ == "__main__":
    sys.exit(main())
