"""Write the accuracy's statistics as JSON."""

import json

from job import job, read_products

from vinsar.evaluation import accuracy
from vinsar.results import storage

with job(snakemake):
    summary = accuracy.summary(read_products(snakemake)["accuracy"])
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(json.dumps(summary, indent=2) + "\n")
