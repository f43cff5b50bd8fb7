# The study as a workflow: ./run, or ./run -n to see what it would do.
# config/paper.yaml holds every value; --configfile config/<study>.yaml overrides some of them.
from snakemake.utils import min_version

min_version("9.27")


configfile: "config/paper.yaml"


# The software is what `run` installs from requirements.lock; this names the Python below it.
container: "docker://python:3.11"


include: "workflow/rules/common.smk"
include: "workflow/rules/lock.smk"


pathvars:
    results=results.folder(STUDY.study).as_posix(),
    logs="<results>/logs",
    benchmarks="<results>/benchmarks",


include: "workflow/rules/own_data.smk"
include: "workflow/rules/stages.smk"
include: "workflow/rules/sweep.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"


rule all:
    default_target: True
    input:
        # Each that another was made from, too: it is missed if it is lost.
        expand("<results>/{product}.nc", product=wanted_products()),
        expand("<results>/sweeps/{sweep}.nc", sweep=shown_sweeps()),
        expand("<results>/{product}.nc", product=pipeline.from_files(STUDY)),
        expand(
            "<results>/figures/{figure}.{suffix}",
            figure=STUDY.outputs.figures,
            suffix=STUDY.figures.formats,
        ),
        expand("<results>/{name}.json", name={"accuracy"}.intersection(STAGES)),
        expand(
            "<results>/claims.{suffix}",
            suffix=["json", "md"] if STUDY.outputs.claims else [],
        ),
