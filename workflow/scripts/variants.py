"""Run the study's variants and tabulate their accuracy."""

from job import job, read_products

from vinsar.results import storage
from vinsar.study import validation
from vinsar.sweeps import variants

with job(snakemake):
    table = variants.as_markdown(
        variants.evaluate(
            validation.check(snakemake.params.configuration), read_products(snakemake)
        )
    )
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(table)
