"""What the report holds: sections of text, tables and pictures, made from a study's results."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vinsar.figures import FIGURES, THUMBNAILS, Thumbnail, height_error
from vinsar.figures.drawing import sweeps, thumbnails
from vinsar.foundations import tables
from vinsar.radar import formulas, instrument
from vinsar.radar.trajectory import Radar
from vinsar.results import lineage
from vinsar.study import pipeline
from vinsar.study.composition import StudyModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from vinsar.foundations.configuration import Study
    from vinsar.foundations.stage import Products

SECTIONS = tuple(name for name in StudyModel.model_fields if name not in {"dask", "variants"})
"""Parts of the configuration that the report shows: not where sweeps run, nor the variants."""

VERDICTS = ("reproduced", "partly", "contradicted", "undecided")
"""Verdicts on claims, as `vinsar.paper.claims` has them."""

# Keys of the section `radar` that mean nothing for a cart on a rail.
_OF_ARRAYS = {"transmitter_x_m", "transmitter_y_m", "transmitter_height_m", "dwell_s"}
_UNITS = {"_hz": " Hz", "_m": " m", "_deg": "°", "_db": " dB", "_s": " s", "_px": " px"}

# Rows of a sweep's table; a longer sweep is for a figure.
_MOST_CASES = 20


@dataclass(frozen=True)
class Text:
    """A paragraph; text between backticks is code."""

    text: str
    kind: str = "text"


@dataclass(frozen=True)
class Code:
    """Lines of code."""

    text: str
    kind: str = "code"


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    name
        Its identifier.
    columns
        Headings.
    align
        A letter for each column: l(eft), r(ight), or m for code, at the left.
    widths
        Share of the width that each column gets on paper; 0 for as much as it needs.
    rows
        Text by row and column.
    note
        Written below it.
    """

    name: str
    columns: tuple[str, ...]
    align: str
    widths: tuple[float, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    kind: str = "table"


@dataclass(frozen=True)
class Picture:
    """A figure with its caption.

    Attributes
    ----------
    name
        Name of the figure.
    label
        What the caption begins with.
    caption
        What the figure shows, and its numbers.
    alt
        The same for those who do not see it.
    png, pdf
        Its files; `pdf` is None where it was not drawn as one.
    share
        Share of the text's width that it takes.
    """

    name: str
    label: str
    caption: str
    alt: str
    png: Path
    pdf: Path | None
    share: float
    kind: str = "picture"


@dataclass(frozen=True)
class Step:
    """A stage of the chain: its name, what its picture shows, its file's size, and the picture."""

    name: str
    shows: str
    takes: str
    png: bytes | None


@dataclass(frozen=True)
class Chain:
    """The stages in order."""

    steps: tuple[Step, ...]
    kind: str = "chain"


@dataclass(frozen=True)
class Tiles:
    """A few numbers that matter most, each with what it is."""

    tiles: tuple[tuple[str, str], ...]
    kind: str = "tiles"


Block = Text | Code | Table | Picture | Chain | Tiles


@dataclass(frozen=True)
class Section:
    """A section of the report."""

    name: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Report:
    """The report.

    Attributes
    ----------
    title, subtitle
        Written above it.
    sections
        In order; `summary`, if there is one, comes before the table of contents.
    """

    title: str
    subtitle: str
    sections: tuple[Section, ...]


@dataclass(frozen=True)
class Sources:
    """What the report is made from.

    Attributes
    ----------
    study
        The configuration, the parts in `SECTIONS`.
    paper
        The configuration of the paper's study, to tell what this one changes; every key.
    products
        The study's products, and sweeps as ``sweeps/<name>``.
    figures
        The figures' files, of any format, in the order to show them.
    records
        Records of the results, as `vinsar.results.lineage.read_records` returns them.
    claims
        The claims as `vinsar.paper.claims.as_json` gives them, if the study has them.
    errata
        The errata as Markdown, of which the report shows the table.
    """

    study: Study
    paper: Mapping[str, Any]
    products: Products
    figures: tuple[Path, ...]
    records: Mapping[str, Mapping[str, Any]]
    claims: tuple[Mapping[str, Any], ...] = ()
    errata: str = ""


def build(sources: Sources) -> Report:
    """Put a study's report together.

    Parameters
    ----------
    sources
        What it is made from.

    Returns
    -------
    Report
        Its sections; one whose results the study lacks is left out.
    """
    study = sources.study
    made = (
        _summary(sources),
        _radar(study),
        _changes(sources),
        _chain(sources),
        _accuracy(sources),
        _figures(sources),
        _claims(sources),
        _errata(sources),
        _sweeps(sources),
        _times(sources),
        _provenance(sources),
    )
    measured = study.measurement.file is not None
    return Report(
        f"Forward-looking InSAR: study “{study.study}”",
        f"From {'measured' if measured else 'simulated'} echoes to the height of the ground ahead",
        tuple(section for section in made if section is not None and section.blocks),
    )


def number(value: float) -> str:
    """Return a number as text, with a real minus sign."""
    return f"{value:.10g}".replace("-", "−")


def _written(value: Any) -> str:
    """Return a value of the configuration as text."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number(value)
    if isinstance(value, (list, tuple)):
        gap = "; " if any(isinstance(item, (dict, list, tuple)) for item in value) else ", "
        return gap.join(_written(item) for item in value) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_written(item)}" for key, item in value.items()) or "none"
    return str(value)


def with_unit(key: str, value: Any) -> str:
    """Return a value of the configuration as text, with the unit that its key ends in."""
    suffix = next((end for end in _UNITS if key.endswith(end)), "")
    if not suffix or isinstance(value, bool) or not isinstance(value, (int, float)):
        return _written(value)
    if suffix == "_hz":
        for scale, unit in ((1e9, "GHz"), (1e6, "MHz"), (1e3, "kHz")):
            if abs(value) >= scale:
                return f"{number(value / scale)} {unit}"
    if suffix == "_s" and 0 < abs(value) < 1e-3:
        return f"{number(value * 1e6)} µs"
    return number(value) + _UNITS[suffix]


def _summary(sources: Sources) -> Section:
    tiles: list[tuple[str, str]] = []
    accuracy = sources.products.get("accuracy")
    if accuracy is not None:
        whole = accuracy.sel(region="whole_scene")
        visible = accuracy.sel(region="visible_ground")
        tolerance = 100 * float(accuracy["tolerance"])
        share = 100 * float(whole["fraction_within_tolerance"])
        delivered = accuracy.sel(region="delivered")
        held = 100 * float(delivered["fraction_within_tolerance"])
        tiles += [
            (f"{100 * float(delivered['share_of_scene']):.1f} %", "of the scene delivered"),
            (f"{held:.1f} %", f"of what is delivered within {tolerance:g} cm"),
            (f"{share:.1f} %", f"of all heights within {tolerance:g} cm"),
            (f"{100 * float(whole['std']):.1f} cm", "standard deviation, whole scene"),
            (f"{100 * float(visible['std']):.1f} cm", "standard deviation, visible ground"),
        ]
    if sources.claims:
        verdicts = Counter(claim["verdict"] for claim in sources.claims)
        found = ", ".join(f"{verdicts[name]} {name}" for name in VERDICTS if verdicts[name])
        tiles.append((f"{verdicts['reproduced']} of {len(sources.claims)}", f"claims: {found}"))
    blocks: list[Block] = [Tiles(tuple(tiles))] if tiles else []
    blocks += _pictures(sources, only=("summary",))
    return Section("summary", "Summary", tuple(blocks))


def _radar(study: Study) -> Section:
    rows = []
    for name, value in study.radar:
        info = Radar.model_fields[name]
        extra: Any = info.json_schema_extra
        if study.radar.system == "rail" and name in _OF_ARRAYS:
            continue
        if study.measurement.channels == 1 and name.startswith("baseline"):
            continue
        shown = with_unit(name, value)
        rows.append((f"`{name}`", str(info.description), shown, str(extra["paper"])))
    given = Table(
        "parameters",
        ("key", "meaning", "value", "in the paper"),
        "llrl",
        (0, 1, 0, 0),
        tuple(rows),
    )
    derived = Table(
        "derived", ("quantity", "value", "unit"), "lrl", (1, 0, 0), tuple(quantities(study))
    )
    middle = _middle(study)
    place = "image" if study.measurement.file is not None else "scene"
    return Section(
        "radar",
        "The radar",
        (
            Text("The values of the paper's Table 1 and those that it leaves open."),
            given,
            Text(
                f"What follows from them, in the middle of the {place} at x = {middle[0]:g} m, "
                f"y = {middle[1]:g} m on the ground:"
            ),
            derived,
        ),
    )


def _middle(study: Study) -> tuple[float, float]:
    # Measured echoes come without a scene.
    return instrument.middle(study.imaging if study.measurement.file is not None else study.scene)


def quantities(study: Study) -> list[tuple[str, str, str]]:
    """Return what follows from the radar's values, each with value and unit.

    Parameters
    ----------
    study
        The configuration.

    Returns
    -------
    list of tuple of str
        Wavelength, resolutions, unambiguous range, and what the baseline means for coherence and
        phase, in the middle of the scene, or of the image where the echoes are measured. On a
        rail, the paper's formulas for a plane wave as well.
    """
    options, place = study.radar, _middle(study)
    planned = instrument.Instrument.planned(options)
    slant, look = float(planned.slant_range(*place)), float(planned.look_angle(*place))
    cell = 100 * planned.resolution(*place)
    critical = float(planned.critical_baseline(*place))
    rows = [
        ("wavelength of the carrier, λ", f"{1000 * planned.wavelength:.2f}", "mm"),
        ("frequency step", f"{planned.frequency_step / 1e6:g}", "MHz"),
        ("unambiguous range", f"{planned.unambiguous_range:.2f}", "m"),
        ("antenna positions", f"{planned.positions}", ""),
        ("slant-range resolution", f"{100 * planned.range_resolution:.2f}", "cm"),
        ("resolution on the ground in x", f"{cell[0]:.1f}", "cm"),
        ("resolution on the ground in y", f"{cell[1]:.1f}", "cm"),
        ("slant range of the lower channel", f"{slant:.3f}", "m"),
        ("its look angle from nadir, θ", f"{np.degrees(look):.2f}", "°"),
    ]
    if study.measurement.channels == 1:
        return rows
    rows += [
        ("critical baseline of this attitude", f"{critical:.2f}", "m"),
        ("a quarter of it, the rule of thumb", f"{critical / 4:.2f}", "m"),
        ("coherence of level ground", f"{float(planned.geometric_coherence(*place)):.3f}", ""),
        ("height of ambiguity", f"{float(planned.height_of_ambiguity(*place)):.3f}", "m"),
        (
            "spread of the height if the phase is random",
            f"{100 * float(planned.random_phase_std(*place)):.1f}",
            "cm",
        ),
    ]
    if options.system == "rail":
        attitude = np.deg2rad(options.baseline_angle_deg)
        _, across = formulas.baseline_components(options.baseline_m, attitude, look)
        plane_wave = formulas.critical_baseline(
            slant, planned.wavelength, look, planned.range_resolution
        )
        rows += [
            ("baseline across the line of sight, B⊥ (Eq. 4)", f"{abs(float(across)):.4f}", "m"),
            ("critical B⊥ of a plane wave", f"{float(plane_wave):.2f}", "m"),
        ]
    return rows


def _changes(sources: Sources) -> Section | None:
    paper = dict(lineage.leaves(dict(sources.paper)))
    skipped = ("study", "outputs.", "sweeps.", "figures.")
    rows = []
    for key, value in lineage.leaves(sources.study.values(SECTIONS)):
        if key.startswith(skipped) or value == paper.get(key, value):
            continue
        rows.append((f"`{key}`", with_unit(key, paper.get(key)), with_unit(key, value)))
    if not rows:
        return None
    table = Table("changes", ("key", "paper's study", "this study"), "lll", (0, 1, 1), tuple(rows))
    text = "Where this study departs from that of the paper:"
    return Section("changes", "What this study changes", (Text(text), table))


def _chain(sources: Sources) -> Section | None:
    steps = []
    for name in (*pipeline.from_files(sources.study), *pipeline.stages(sources.study)):
        if name not in sources.products:
            continue
        record = sources.records.get(f"{name}.nc", {})
        thumbnail = THUMBNAILS.get(name, Thumbnail(name.replace("_", " ")))
        steps.append(
            Step(
                name,
                thumbnail.shows,
                _seconds(record["seconds"]) if "seconds" in record else "",
                thumbnails.png(thumbnail, sources.products[name], sources.study.figures),
            )
        )
    if not steps:
        return None
    text = "Each stage with a picture of its product, `<stage>.nc`, and the time it took."
    return Section("chain", "The chain", (Text(text), Chain(tuple(steps))))


def _accuracy(sources: Sources) -> Section | None:
    accuracy = sources.products.get("accuracy")
    if accuracy is None:
        return None
    names, units, *rows = height_error.table_rows(accuracy)
    headings = tuple(
        f"{name} ({unit})" if unit and "," not in unit else f"{name} {unit}".strip()
        for name, unit in zip(names, units, strict=True)
    )
    table = Table(
        "accuracy",
        ("region", *headings[1:]),
        "l" + "r" * (len(headings) - 1),
        (1, *(0 for _ in headings[1:])),
        tuple(tuple(row) for row in rows),
        "Of cells that were reconstructed; a cell is in shadow if either antenna sees it from "
        "fewer than half of its positions. |e| is the absolute error; found is the share of "
        "cells with a height.",
    )
    text = "The height error, reconstructed minus true."
    return Section("accuracy", "Accuracy", (Text(text), table))


def shown_figures(sources: Sources) -> list[str]:
    """Return the names of the figures that the report shows, the panels of a sheet left out."""
    names = list(dict.fromkeys(path.stem for path in sources.figures if path.suffix == ".png"))
    return [name for name in names if FIGURES[name].sheet not in names]


def _label(name: str) -> str:
    title = FIGURES[name].title
    figure = name.removeprefix("fig")
    return f"Figure {figure}. {title}." if figure.isdigit() else f"{title}."


def _pictures(sources: Sources, *, only: tuple[str, ...] = ()) -> list[Block]:
    files = {(path.stem, path.suffix): path for path in sources.figures}
    pictures: list[Block] = []
    for name in shown_figures(sources):
        if (name in only) != bool(only):
            continue
        figure = FIGURES[name]
        numbers = ""
        if figure.numbers is not None and all(key in sources.products for key in figure.reads):
            numbers = figure.numbers(sources.products, sources.study)
        caption = " ".join(figure.caption.replace("``", "`").split())
        png = files[name, ".png"]
        pictures.append(
            Picture(
                name,
                _label(name),
                f"{caption} {numbers}".strip(),
                f"{_label(name)} {caption} {numbers}".replace("`", "").strip(),
                png,
                files.get((name, ".pdf")),
                0.55 if _narrow(png, sources.study) else 1.0,
            )
        )
    return pictures


def _narrow(png: Path, study: Study) -> bool:
    """Return whether a figure has the width of one column."""
    from PIL import Image

    with Image.open(png) as image:
        width_mm = image.width / study.figures.png_dpi * 25.4
    return width_mm < (study.figures.one_column_mm + study.figures.two_columns_mm) / 2


def _figures(sources: Sources) -> Section | None:
    shown = [name for name in shown_figures(sources) if name != "summary"]
    pictures = _pictures(sources, only=tuple(shown)) if shown else []
    return Section("figures", "Figures", tuple(pictures))


def _claims(sources: Sources) -> Section | None:
    if not sources.claims:
        return None
    table = Table(
        "claims",
        ("claim", "where", "the paper says", "this study finds", "verdict"),
        "lllll",
        (0, 0, 1, 1.5, 0),
        tuple(
            (claim["id"], claim["where"], claim["paper"], claim["ours"], claim["verdict"])
            for claim in sources.claims
        ),
    )
    criteria = Table(
        "criteria",
        ("claim", "what decides"),
        "ll",
        (0, 1),
        tuple((claim["id"], claim["criterion"]) for claim in sources.claims),
    )
    text = "The paper's claims, each decided by a criterion on the numbers of this study."
    return Section("claims", "Claims", (Text(text), table, Text("Criteria:"), criteria))


def _errata(sources: Sources) -> Section | None:
    # They are of the paper, and so of the study that is held against it.
    rows = tables.read(sources.errata) if sources.claims else []
    if len(rows) < 2:
        return None
    widths = (0, 1.2, 2.4, 0.9)[: len(rows[0])]
    table = Table("errata", rows[0], "l" * len(rows[0]), widths, tuple(rows[1:]))
    text = "What the paper prints, why it is wrong, and what this study uses instead."
    return Section("errata", "Errata of the paper", (Text(text), table))


def _sweeps(sources: Sources) -> Section | None:
    shown_by: dict[str, list[str]] = {}
    for name in shown_figures(sources):
        for sweep in FIGURES[name].sweeps:
            shown_by.setdefault(sweep, []).append(name)
    rows: list[tuple[str, ...]] = []
    details: list[Block] = []
    for name, definition in sources.study.sweeps.items():
        product = sources.products.get(f"sweeps/{name}")
        if product is None:
            continue
        over = "; ".join(
            f"`{key}`: {', '.join(_written(value) for value in values)}"
            for key, values in definition.over.items()
        )
        cases = int(np.prod([len(values) for values in definition.over.values()]))
        runs = cases * definition.realizations
        rows.append(
            (name, over, str(definition.realizations), str(runs),
             ", ".join(shown_by.get(name, [])))
        )  # fmt: skip
        if len(definition.over) == 1 and cases <= _MOST_CASES:
            means = _sweep_table(name, next(iter(definition.over)), product)
            details += [Text(f"Means over the realizations of `{name}`:"), means]
    if not rows:
        return None
    overview = Table(
        "sweeps",
        ("sweep", "goes over", "realizations", "runs", "figure"),
        "llrrl",
        (0, 1, 0, 0, 0),
        tuple(rows),
    )
    return Section("sweeps", "Sweeps", (overview, *details))


def _sweep_table(name: str, key: str, product: Any) -> Table:
    dim = key.replace(".", "_")
    columns = (
        ("std, whole scene (cm)", "std", "whole_scene", 100.0),
        ("std, visible ground (cm)", "std", "visible_ground", 100.0),
        ("within tolerance (%)", "fraction_within_tolerance", "whole_scene", 100.0),
    )
    means = [
        scale * sweeps.spread(product[variable].sel(region=region).transpose(dim, "realization"))[0]
        for _, variable, region, scale in columns
    ]
    coherence = sweeps.spread(product["coherence"].transpose(dim, "realization"))[0]
    rows = tuple(
        (
            _written(value.item() if hasattr(value, "item") else value),
            *(f"{mean[index]:.2f}" for mean in means[:2]),
            f"{means[2][index]:.1f}",
            f"{coherence[index]:.3f}",
        )
        for index, value in enumerate(product[dim].values)
    )
    titles = (f"`{key}`", *(column[0] for column in columns), "coherence, visible ground")
    return Table(f"sweep-{name}", titles, "rrrrr", (1, 1, 1, 1, 1), rows)


def _seconds(value: float) -> str:
    return f"{value:.1f} s" if value < 100 else f"{value / 60:.1f} min"


def _size(count: float) -> str:
    return f"{count / 1e6:.2f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"


def _times(sources: Sources) -> Section | None:
    jobs: dict[str, list[Mapping[str, Any]]] = {}
    for record in sources.records.values():
        rule = record["rule"]
        name = record["provenance"].get("vinsar_stage", rule) if rule == "sweep" else rule
        jobs.setdefault(name, []).append(record)
    jobs.pop("report", None)
    if not jobs:
        return None
    ordered = sorted(jobs.items(), key=lambda item: min(r["started"] for r in item[1]))
    taken = {name: max(record["seconds"] for record in records) for name, records in ordered}
    total = sum(taken.values())
    rows = [
        (
            name.replace("_", " "),
            f"{taken[name]:.2f}",
            f"{100 * taken[name] / total:.1f}" if total else "",
            str(max(record.get("threads", 1) for record in records)),
            _size(max(record.get("peak_bytes", 0) for record in records)),
            str(len(records)),
            _size(sum(record["bytes"] for record in records)),
        )
        for name, records in ordered
    ]
    rows.append(("all", f"{total:.2f}", "", "", "", str(len(sources.records)), ""))
    table = Table(
        "times",
        ("job", "seconds", "share (%)", "threads", "peak memory", "files", "size"),
        "lrrrrrr",
        (1, 0, 0, 0, 0, 0, 0),
        tuple(rows),
    )
    text = (
        "How long each job took when its results were made, in the order in which they began, and "
        "the most memory that one of its processes held."
    )
    return Section("times", "Stage times", (Text(text), table))


def _provenance(sources: Sources) -> Section | None:
    records = sources.records
    if not records:
        return None
    described = [record["provenance"] for record in records.values()]

    def distinct(values: Iterator[str]) -> str:
        return ", ".join(sorted({value for value in values if value}))

    libraries: dict[str, set[str]] = {}
    code: dict[str, set[str]] = {}
    for attributes in described:
        for name, version in json.loads(attributes["vinsar_libraries"]).items():
            libraries.setdefault(name, set()).add(version)
        for name, sha in json.loads(attributes["vinsar_code"]).items():
            code.setdefault(name, set()).add(sha)
    digest = hashlib.sha256(
        json.dumps({name: sorted(shas) for name, shas in code.items()}, sort_keys=True).encode()
    ).hexdigest()
    commits = distinct(item.get("vinsar_commit", "") for item in described)
    facts = Table(
        "made-with",
        ("what", "value"),
        "ll",
        (0, 1),
        (
            ("software", distinct(item["source"] for item in described)),
            ("commit", commits),
            ("code", f"{len(code)} files, `{digest}`"),
            ("Python", distinct(record["python"] for record in records.values())),
            ("platform", distinct(record["platform"] for record in records.values())),
            ("seed", f"{sources.study.seed}, realization {sources.study.realization}"),
            (
                "libraries",
                ", ".join(f"{name} {'/'.join(sorted(v))}" for name, v in sorted(libraries.items())),
            ),
        ),
    )
    name = sources.study.study
    option = "" if name == "paper" else f" --configfile config/{name}.yaml"
    lines = [f"git checkout {commits}"] if "," not in commits and "dirty" not in commits else []
    lines += [
        f"./run report{option}",
        f"./run verify results/{name}",
        f"./run trace results/{name}/report.html",
    ]
    digests = Table(
        "digests",
        ("result", "SHA-256"),
        "lm",
        (1, 0),
        tuple(
            (path, record["sha256"])
            for path, record in sorted(records.items())
            if not path.startswith("report.")
        ),
    )
    return Section(
        "provenance",
        "Provenance",
        (
            Text("The results of this report were made with:"),
            facts,
            Text(
                "To make them again, check them, and trace them to configuration, code and seeds:"
            ),
            Code("\n".join(lines)),
            Text(
                "Each result carries its own provenance; these are the digests of the files, which "
                "the same inputs give again."
            ),
            digests,
        ),
    )
