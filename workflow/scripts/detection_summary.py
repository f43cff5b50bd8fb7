"""Write how well obstacles and holes are found as tables."""

from job import job, read_products

from vinsar.evaluation import detection_accuracy
from vinsar.foundations.configuration import swept_section
from vinsar.results import storage
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    name = detection_accuracy.SWEEP
    sweep = read_products(snakemake)[f"sweeps/{name}"]
    sections = (swept_section(study, name, part) for part in ("scene", "detection"))
    scene, options = sections
    with storage.atomic(snakemake.output[0]) as path:
        path.write_text(detection_accuracy.as_markdown(sweep, scene.objects, options))
