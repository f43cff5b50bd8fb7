"""Tabulate registered images beside focused ones, with the claim that they decide."""

from job import job, read_products

from vinsar.evaluation import registered
from vinsar.paper import claims
from vinsar.results import storage

with job(snakemake):
    found = read_products(snakemake)["registered"]
    text = (
        registered.as_markdown(found)
        + "\n"
        + claims.as_markdown([claims.registration_needed(found)])
    )
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(text)
