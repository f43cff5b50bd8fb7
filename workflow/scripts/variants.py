"""Run the study's variants and tabulate their accuracy."""

from job import job

from vinsar import storage, validation, variants

with job(snakemake):
    table = variants.as_markdown(
        variants.evaluate(validation.check(snakemake.params.configuration))
    )
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(table)
