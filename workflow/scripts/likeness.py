"""Tabulate the open choices beside the published figures."""

from job import job, read_products

from vinsar.paper import likeness
from vinsar.results import storage

with job(snakemake):
    sweeps = {name.removeprefix("sweeps/"): data for name, data in read_products(snakemake).items()}
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(likeness.as_markdown(sweeps), encoding="utf-8")
