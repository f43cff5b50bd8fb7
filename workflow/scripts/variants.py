"""Run the study's variants and tabulate their accuracy."""

from job import job, read_products

from vinsar import storage, validation, variants

with job(snakemake):
    table = variants.as_markdown(
        variants.evaluate(
            validation.check(snakemake.params.configuration), read_products(snakemake)
        )
    )
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(table)
