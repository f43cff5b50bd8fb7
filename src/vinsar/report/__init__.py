"""The report of a study: one content, written as a web page and as a PDF.

`content.build` puts its content together, `render` writes it. Neither knows the workflow: what a
study lacks, such as claims or a true terrain, is left out.
"""

from __future__ import annotations

from vinsar.report.content import SECTIONS, Report, Sources, build
from vinsar.report.render import TEMPLATES, as_html, as_pdf

__all__ = ["SECTIONS", "TEMPLATES", "Report", "Sources", "as_html", "as_pdf", "build"]
