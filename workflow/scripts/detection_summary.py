"""Write how well obstacles and holes are found as tables."""

from job import job, read_products

from vinsar.evaluation import detection_accuracy
from vinsar.results import storage
from vinsar.study import config

with job(snakemake):
    study = config.Study.part(snakemake.params.configuration)
    name = detection_accuracy.SWEEP
    sweep = read_products(snakemake)[f"sweeps/{name}"]
    sections = (config.swept_section(study, name, part) for part in ("scene", "detection"))
    scene, options = sections
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(detection_accuracy.as_markdown(sweep, scene.objects, options))
