"""Write the design sheet."""

from job import job

from vinsar import design, storage, validation

with job(snakemake):
    sheet = design.Sheet(validation.check(snakemake.params.configuration))
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(design.as_markdown(sheet))
