"""The report as a web page and as a PDF, by a template each."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar.report.content import VERDICTS, Chain, Picture, Report

if TYPE_CHECKING:
    from collections.abc import Mapping

_HTML = Path(__file__).with_name("report.html.jinja")
_TYPST = Path(__file__).with_name("report.typ")

TEMPLATES = (_HTML, _TYPST)
"""The templates, which are code of the report as its modules are."""


def as_html(report: Report, provenance: Mapping[str, str]) -> str:
    """Return the report as one web page that needs no other file and no network.

    Parameters
    ----------
    report
        The content.
    provenance
        Attributes that say where the report comes from; the page carries them as JSON.

    Returns
    -------
    str
        HTML; pictures are data URIs, and a content security policy forbids all else.
    """
    import jinja2

    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"inline": _inline, "data_uri": _data_uri, "size": _pixels}
    template = environment.from_string(_HTML.read_text(encoding="utf-8"))
    # Within a script element, "</" and "<!--" mean something, whatever it holds.
    packed = json.dumps(dict(provenance), sort_keys=True).replace("<", "\\u003c")
    return template.render(report=report, verdicts=VERDICTS, provenance=packed)


def _inline(text: str) -> Any:
    """Return text as HTML: text between backticks is code."""
    from markupsafe import Markup, escape

    escaped = str(escape(text))
    code = re.sub(r"`([^`]*)`", lambda found: f"<code>{found[1]}</code>", escaped)
    return Markup(code)  # noqa: S704 (escaped above)


def _data_uri(png: bytes | Path) -> str:
    data = png.read_bytes() if isinstance(png, Path) else png
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")


def _pixels(png: bytes | Path) -> tuple[int, int]:
    """Return width and height of a PNG, from its header."""
    head = png.read_bytes()[:24] if isinstance(png, Path) else png[:24]
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def as_pdf(report: Report, provenance: Mapping[str, str]) -> bytes:
    """Return the report as a PDF.

    Typst sets it: its compiler comes whole in its wheel, with its fonts, needs nothing of the
    system, and gives the same bytes for the same report.

    Parameters
    ----------
    report
        The content.
    provenance
        Attributes that say where the report comes from; the PDF carries them as its keywords.

    Returns
    -------
    bytes
        The PDF; figures are vectors where the study draws them as PDF.
    """
    import typst

    # A bracket would end the keywords for a simple reader.
    keywords = json.dumps(dict(provenance), sort_keys=True)
    keywords = keywords.replace("(", "\\u0028").replace(")", "\\u0029")
    with tempfile.TemporaryDirectory(prefix="vinsar-report-") as name:
        folder = Path(name)
        plain = _plain(report, folder) | {"keywords": keywords, "verdicts": list(VERDICTS)}
        (folder / "report.json").write_text(json.dumps(plain), encoding="utf-8")
        shutil.copy(_TYPST, folder / "report.typ")
        return bytes(typst.compile(folder / "report.typ", root=folder, ignore_system_fonts=True))


def _plain(report: Report, folder: Path) -> dict[str, Any]:
    """Return the report for JSON, with its pictures copied into a folder."""
    sections = []
    for section in report.sections:
        blocks = []
        for block in section.blocks:
            plain = dataclasses.asdict(block)
            if isinstance(block, Picture):
                source = block.pdf or block.png
                plain["file"] = f"{block.name}{source.suffix}"
                shutil.copy(source, folder / plain["file"])
                del plain["png"], plain["pdf"]
            elif isinstance(block, Chain):
                for step in plain["steps"]:
                    png = step.pop("png")
                    step["file"] = f"stage-{step['name']}.png" if png else ""
                    if png:
                        (folder / step["file"]).write_bytes(png)
            blocks.append(plain)
        sections.append({"name": section.name, "title": section.title, "blocks": blocks})
    return {"title": report.title, "subtitle": report.subtitle, "sections": sections}
