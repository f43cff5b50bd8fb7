"""Figures to files: the same bytes for the same figure, and no file that is half written."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vinsar.figures.drawing import style
from vinsar.results import storage

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from matplotlib.figure import Figure

FORMATS = ("pdf", "svg", "png")

# Only what Matplotlib draws as pixels inside a vector file: the shaded surface.
_RASTER_DPI = 300

_INLINE_DPI = 150


def save(
    figure: Figure,
    paths: Iterable[str | os.PathLike[str]],
    *,
    png_dpi: float,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write a figure to files, each in the format of its suffix.

    Fonts are embedded as TrueType in PDF and text stays text in SVG. No file holds a date or a
    version of Matplotlib, so the same figure gives the same bytes.

    Parameters
    ----------
    figure
        The figure.
    paths
        Files to write: .pdf, .svg or .png. Each appears whole or not at all.
    png_dpi
        Resolution of PNG files, dots per inch.
    metadata
        Where the figure comes from. PNG holds each entry as a text chunk; PDF (`Keywords`) and
        SVG (`dc:description`) hold all as one JSON object.

    Raises
    ------
    ValueError
        If a suffix is none of these; nothing is written then.
    """
    targets = [Path(path) for path in paths]
    for path in targets:
        if path.suffix.lstrip(".") not in FORMATS:
            raise ValueError(
                f"'{path}' has the suffix '{path.suffix}'; a figure is written as "
                f"{', '.join('.' + name for name in FORMATS)}"
            )
    with style.applied(style.options_of(figure)):
        for path in targets:
            kind = path.suffix.lstrip(".")
            with storage.atomic(path) as part:
                figure.savefig(
                    part,
                    format=kind,
                    dpi=png_dpi if kind == "png" else _RASTER_DPI,
                    facecolor="white",
                    metadata=_metadata(kind, metadata or {}),
                )


def shown_inline(figure: Figure) -> Figure:
    """Return a figure that a notebook shows as what a cell returns, whatever its backend."""

    def png() -> bytes:
        buffer = io.BytesIO()
        with style.applied(style.options_of(figure)):
            figure.savefig(buffer, format="png", dpi=_INLINE_DPI, facecolor="white")
        return buffer.getvalue()

    # IPython's protocol, which objects of foreign classes take part in by attribute.
    figure._repr_png_ = png  # type: ignore[attr-defined]
    return figure


def _metadata(kind: str, metadata: Mapping[str, str]) -> dict[str, Any]:
    """Return Matplotlib's metadata for a format; None takes out what it adds unasked."""
    packed = json.dumps(dict(metadata), sort_keys=True) if metadata else None
    if kind == "pdf":
        return {"Creator": None, "Producer": None, "CreationDate": None, "Keywords": packed}
    if kind == "svg":
        return {"Creator": None, "Date": None, "Description": packed}
    return {"Software": None} | {key: metadata[key] for key in sorted(metadata)}
