"""Read a measured or surveyed file and write the products that the chain takes from it."""

from pathlib import Path

from job import attributes, job, stage_of

from vinsar.results import storage
from vinsar.study import ingest
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    products = ingest.read(study)
    for path in snakemake.output:
        name = Path(path).stem
        storage.write(products[name], path, name, attributes(snakemake, stage_of(snakemake, path)))
