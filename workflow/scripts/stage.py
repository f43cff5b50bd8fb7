"""Compute the stage of the rule's name and write its product."""

from job import attributes, job, read_products

from vinsar.results import storage
from vinsar.study import config, pipeline

with job(snakemake):
    study = config.Study.part(snakemake.params.configuration)
    product = pipeline.run_stage(snakemake.rule, read_products(snakemake), study)
    storage.write(
        product, snakemake.output[0], snakemake.rule, attributes(snakemake, snakemake.rule)
    )
