"""Draw the rule's figures and save each in its formats."""

from pathlib import Path

from job import attributes, job, read_products

from vinsar import figures
from vinsar.study.composition import StudyModel

with job(snakemake):
    study = StudyModel.part(snakemake.params.configuration)
    products = read_products(snakemake)
    for name in dict.fromkeys(Path(path).stem for path in snakemake.output):
        figures.save(
            figures.FIGURES[name].draw(products, study),
            [path for path in snakemake.output if Path(path).stem == name],
            png_dpi=study.figures.png_dpi,
            metadata=attributes(snakemake, name),
        )
