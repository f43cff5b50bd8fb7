"""Write the study's report as a web page and as a PDF."""

import json
from pathlib import Path

import yaml
from job import attributes, job, product_paths

from vinsar import report
from vinsar.results import lineage, storage
from vinsar.study.composition import StudyModel


def sources():
    """Gather what the report is made from."""
    paths = {name: Path(path) for name, path in product_paths(snakemake).items()}
    products = {
        name: storage.read(path, "sweep" if name.startswith("sweeps/") else name)
        for name, path in paths.items()
        if path.suffix == ".nc"
    }
    figures = [path for path in paths.values() if path.parent.name == "figures"]
    claims = paths.get("claims.json")
    texts = {Path(path).name: Path(path) for path in snakemake.input.code}
    return report.Sources(
        study=StudyModel.part(snakemake.params.configuration),
        paper=yaml.safe_load(texts["paper.yaml"].read_text(encoding="utf-8")),
        products=products,
        figures=tuple(figures),
        records=lineage.read_records(Path(snakemake.output.html).parent),
        claims=tuple(json.loads(claims.read_text(encoding="utf-8"))) if claims else (),
        errata=texts["errata.md"].read_text(encoding="utf-8"),
    )


with job(snakemake):
    content = report.build(sources())
    origin = attributes(snakemake, "report")
    with storage.atomic(snakemake.output.html) as path:
        path.write_text(report.as_html(content, origin), encoding="utf-8")
    with storage.atomic(snakemake.output.pdf) as path:
        path.write_bytes(report.as_pdf(content, origin))
