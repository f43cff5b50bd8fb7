"""Tabulate the antenna arrangements side by side."""

from job import job, read_products

from vinsar.prediction import systems
from vinsar.results import storage
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    found = systems.compare(read_products(snakemake)[f"sweeps/{systems.SWEEP}"], study)
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(systems.as_markdown(found))
