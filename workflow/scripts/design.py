"""Write the design sheet."""

from job import job

from vinsar.prediction import design
from vinsar.results import storage
from vinsar.study import validation

with job(snakemake):
    sheet = design.Sheet(validation.check(snakemake.params.configuration))
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(design.as_markdown(sheet))
