"""Compute the stage of the rule's name and write its product."""

from job import attributes, job, read_products

from vinsar.results import storage
from vinsar.study import pipeline
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    product = pipeline.run_stage(snakemake.rule, read_products(snakemake), study)
    storage.write(
        product, snakemake.output[0], snakemake.rule, attributes(snakemake, snakemake.rule)
    )
