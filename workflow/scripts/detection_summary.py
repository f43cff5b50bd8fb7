"""Write how well obstacles and holes are found as tables."""

from job import job, read_products

from vinsar.evaluation import detection_accuracy
from vinsar.figures import obstacles
from vinsar.results import storage
from vinsar.study import config

with job(snakemake):
    study = config.Study.part(snakemake.params.configuration)
    sweep = read_products(snakemake)[f"sweeps/{obstacles.SWEEP}"]
    sections = (
        config.swept_section(study, obstacles.SWEEP, name) for name in ("scene", "detection")
    )
    scene, options = sections
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(detection_accuracy.as_markdown(sweep, scene.objects, options))
