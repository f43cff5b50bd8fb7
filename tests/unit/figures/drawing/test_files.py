"""Figures in files: whole, with their metadata, and in the resolution asked for."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from vinsar import figures
from vinsar.figures.drawing import files, style

FORMATS = ["pdf", "svg", "png"]


@pytest.fixture(scope="module")
def saved(save_all, sheet, tmp_path_factory):
    return save_all(sheet, tmp_path_factory.mktemp("saved"))


def test_same_figure_gives_same_bytes(save_all, saved, sheet, tmp_path):
    # Saved before, and once more.
    assert save_all(sheet, tmp_path) == saved


def test_svg_keeps_text_as_text(saved):
    svg = saved["svg"].decode("utf-8")
    texts = re.findall(r"<text[^>]*>([^<]+)</text>", svg)
    assert "(h) reconstructed height" in texts
    assert "−π" in texts


def test_png_has_the_resolution_asked_for(png_chunks, saved):
    chunks = dict(png_chunks(saved["png"]))
    width, _ = struct.unpack(">II", chunks["IHDR"][:8])
    assert width == pytest.approx(180 / 25.4 * 60, abs=1)
    per_metre, _, unit = struct.unpack(">IIB", chunks["pHYs"])
    assert unit == 1
    assert per_metre * 0.0254 == pytest.approx(60, abs=0.1)


def test_metadata_comes_back_from_every_format(png_chunks, tmp_path):
    metadata = {"study": "paper", "inputs": "a & b <ü>", "code": "0123"}
    paths = [tmp_path / f"fig1.{suffix}" for suffix in FORMATS]
    figures.save(style.new_figure(50, 50), paths, png_dpi=50, metadata=metadata)
    pdf, svg, png = (path.read_bytes() for path in paths)
    keywords = re.search(rb"/Keywords \((.*?[^\\])\)", pdf, re.DOTALL)
    assert keywords
    assert json.loads(keywords[1].replace(rb"\\", b"\\")) == metadata
    description = re.search(r"<dc:description>(.*?)</dc:description>", svg.decode("utf-8"))
    assert description
    plain = description[1]
    for entity, character in (("&quot;", '"'), ("&lt;", "<"), ("&gt;", ">"), ("&amp;", "&")):
        plain = plain.replace(entity, character)
    assert json.loads(plain) == metadata
    texts = [data.split(b"\0", 1) for name, data in png_chunks(png) if name == "tEXt"]
    assert {key.decode(): value.decode("latin-1") for key, value in texts} == metadata


def test_other_suffixes_are_refused_before_anything_is_written(tmp_path):
    figure = style.new_figure(50, 50)
    with pytest.raises(ValueError, match=r"'\.jpg'.*\.pdf, \.svg, \.png"):
        figures.save(figure, [tmp_path / "a.png", tmp_path / "a.jpg"], png_dpi=50)
    assert not list(tmp_path.iterdir())


def test_failed_write_leaves_the_old_file_and_no_rest(tmp_path, monkeypatch):
    path = tmp_path / "fig.png"
    path.write_bytes(b"old")

    def fail(self, target, **_):
        del self
        Path(target).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        files.save(style.new_figure(50, 50), [path], png_dpi=50)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fig.png"]
