"""Decide the paper's claims and write them as JSON and as a table."""

import json

from job import job, read_products

from vinsar.paper import claims
from vinsar.results import storage
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    found = claims.evaluate(read_products(snakemake), study)
    with storage.atomic(snakemake.output.json) as path:
        path.write_text(json.dumps(claims.as_json(found), indent=2) + "\n")
    with storage.atomic(snakemake.output.markdown) as path:
        path.write_text(claims.as_markdown(found))
