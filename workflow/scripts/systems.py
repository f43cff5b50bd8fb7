"""Tabulate the antenna arrangements side by side."""

from job import job, read_products

from vinsar import config, storage, systems

with job(snakemake):
    study = config.Study.part(snakemake.params.configuration)
    found = systems.compare(read_products(snakemake)[f"sweeps/{systems.SWEEP}"], study)
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(systems.as_markdown(found))
