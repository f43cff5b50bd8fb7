"""The report as a reader opens it: in a browser without a network, and as a PDF."""

import html
import json
import re
import sys
from pathlib import Path

import pytest

import vinsar
from vinsar import figures
from vinsar.results import lineage
from vinsar.study import pipeline

sys.path.insert(0, str(Path(__file__).parent))
import browser

ROOT = Path(__file__).parents[2]
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
ADDRESS = "https://example.org/x.png"
LOOK = """
(async () => {
  const images = [...document.images];
  await Promise.all(images.map(image => image.decode().catch(() => null)));
  const cells = row => [...row.cells].map(cell => cell.textContent);
  const table = document.querySelector("#table-claims");
  return {
    images: images.map(image => [image.alt, image.naturalWidth]),
    claims: table ? [...table.tBodies[0].rows].map(cells) : [],
    links: [...document.links].map(link => link.getAttribute("href")),
    ids: [...document.querySelectorAll("[id]")].map(element => element.id),
    scripts: [...document.scripts].map(script => script.type),
    wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  };
})()
"""


@pytest.fixture(scope="module")
def made(checkout):
    """Make the report; the checkout is left as it was."""
    done = checkout.snakemake("report")
    assert done.returncode == 0, done.stdout + done.stderr
    yield checkout.results
    for folder in (checkout.results, checkout.results / lineage.RECORDS):
        for path in folder.glob("report.*"):
            path.unlink()


@pytest.fixture(scope="module")
def pages(made, tmp_path_factory):
    """Open the report as it is, without its policy, and spoilt; each as its browser saw it."""
    folder = tmp_path_factory.mktemp("pages")
    text = (made / "report.html").read_text(encoding="utf-8")
    assert len(POLICY.findall(text)) == 1
    free = POLICY.sub("", text)
    texts = {
        "whole": text,
        "free": free,
        "spoilt": free.replace("</main>", f'<img src="{ADDRESS}" alt="x"></main>'),
    }
    paths = []
    for name, content in texts.items():
        paths.append(folder / f"{name}.html")
        paths[-1].write_text(content, encoding="utf-8")
    visited = browser.visit(paths, LOOK, tmp_path_factory.mktemp("profile"))
    return dict(zip(texts, visited, strict=True))


def test_every_picture_loads_and_is_described(pages, made):
    images = pages["whole"].value["images"]
    study = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    shown = [name for name in study.outputs.figures if not figures.FIGURES[name].sheet]
    stages = [name for name in pipeline.STAGES if (made / f"{name}.nc").is_file()]
    pictured = [name for name in stages if figures.THUMBNAILS[name].draw is not None]
    assert len(images) == len(shown) + len(pictured)
    assert all(width > 100 for _, width in images)
    assert all(len(alt) > 10 for alt, _ in images)
    assert {f"figure-{name}" for name in shown} <= set(pages["whole"].value["ids"])


def test_nothing_asks_the_network(pages):
    # By the browser's own log of requests, and without the policy that would forbid them.
    for name in ("whole", "free"):
        requested = [url for url in pages[name].requested if not url.startswith("data:")]
        assert [url.partition(":")[0] for url in requested] == ["file"], name
        # The provenance is data, not a program.
        assert pages[name].value["scripts"] == ["application/json"]
    assert ADDRESS in pages["spoilt"].requested
    assert ["x", 0] in pages["spoilt"].value["images"]


def test_claims_are_those_of_the_study(pages, made):
    claims = json.loads((made / "claims.json").read_text())
    keys = ("id", "where", "paper", "ours", "verdict")
    # Backticks stand for code, as in Markdown.
    expected = [[claim[key].replace("`", "") for key in keys] for claim in claims]
    assert pages["whole"].value["claims"] == expected


def test_contents_lead_somewhere_and_nothing_is_too_wide(pages):
    found = pages["whole"].value
    assert len(found["ids"]) == len(set(found["ids"]))
    assert found["links"]
    assert {link.removeprefix("#") for link in found["links"]} <= set(found["ids"])
    assert found["wide"] == 0


def test_both_files_carry_their_provenance_and_are_up_to_date(checkout, made):
    described = [lineage.read_provenance(made / f"report.{end}") for end in ("html", "pdf")]
    assert described[0] == described[1]
    inputs = json.loads(described[0]["vinsar_inputs"])
    assert {"dem", "accuracy", "claims.json", "figures/fig4.png", "sweeps/snr"} <= set(inputs)
    assert "src/vinsar/report/report.typ" in json.loads(described[0]["vinsar_code"])
    again = checkout.snakemake("-n", "report")
    assert "Nothing to be done" in again.stdout + again.stderr
    verified = checkout.ask("verify", "results/tiny", "--configfile", "tiny.yaml")
    assert verified.returncode == 0, verified.stdout
    traced = checkout.ask("trace", "results/tiny/report.html", "--configfile", "tiny.yaml")
    assert "figures/fig4.png (fig4)" in traced.stdout
    assert "CHANGED" not in traced.stdout


def test_snakemake_s_own_report_has_every_figure_with_its_caption(checkout, tmp_path):
    target = tmp_path / "snakemake.html"
    done = checkout.snakemake("--report", str(target))
    assert done.returncode == 0, done.stdout + done.stderr
    text = html.unescape(target.read_text(encoding="utf-8"))
    for category in ("Figures", "Numbers", "Claims"):
        assert f'"{category}"' in text
    study = vinsar.load(ROOT / "tests/workflow/tiny.yaml")
    captions = [figures.FIGURES[name].caption for name in study.outputs.figures]
    captions += ["Statistics of the height error in metres", "what this study finds, and the verd"]
    for caption in captions:
        assert caption[:60] in text, caption
