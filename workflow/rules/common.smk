# The checked configuration, and the parts of it and of the library that rules depend on.
import os
from functools import cache, partial

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

from vinsar import figures, results
from vinsar import report as study_report
from vinsar.evaluation import detection_accuracy
from vinsar.foundations.errors import ConfigurationError
from vinsar.paper import claims, likeness
from vinsar.prediction import design, systems
from vinsar.results import provenance
from vinsar.simulation.scene import ELEVATION
from vinsar.study import composition, ingest, pipeline, work
from vinsar.sweeps import sweep

try:
    STUDY = ingest.check(config)
    STAGES = pipeline.stages(STUDY)
    figures.check(STUDY, {*STAGES, *pipeline.from_files(STUDY)})
    if workflow.is_main_process:
        # For its faults alone: a file that cannot be used is refused before anything runs.
        ingest.read(STUDY)
except ConfigurationError as error:
    raise WorkflowError(str(error)) from None

if workflow.is_main_process:
    for sentence in design.Sheet(STUDY).warnings():
        logger.warning(f"Configuration: {sentence}")
    logger.info(f"Work: {work.sentence(STUDY)}")


def configuration(*sections):
    """The sections that a job reads, and no others: a change elsewhere must not rerun it."""
    return {"study": STUDY.study} | dict(sorted(STUDY.values(sections).items()))


def sources_of(*modules, script):
    """The files that a job runs: its script and, what Snakemake does not follow, the library."""
    # The bytes of a result depend on how it is stored, too.
    library = [
        os.path.relpath(path)
        for path in provenance.sources_of(*modules, "results.storage")
    ]
    return [*library, f"workflow/scripts/{script}.py", "workflow/scripts/job.py"]


def stage_configuration(name):
    return configuration(*composition.STAGES[name].sections)


def refuse_without_truth(name, wildcards):
    if STUDY.measurement.file is None:
        raise WorkflowError(
            f"The options of the study '{STUDY.study}' ask for no '{name}'."
        )
    raise WorkflowError(
        f"There is no '{name}' in the study '{STUDY.study}': its echoes are measured "
        "(measurement.file), and what needs the true scene is left out."
    )


def if_made(name, files):
    """Files that a rule reads, unless the study is without the rule's stage."""
    return files if name in STAGES else partial(refuse_without_truth, name)


def stage_sources(name):
    # The engine hands the stage its part of the configuration; what else it imports is not run.
    library = sources_of(composition.STAGES[name].module, script="stage")
    return if_made(name, [*library, os.path.relpath(pipeline.__file__)])


def product_files(*names):
    return {name: f"<results>/{name}.nc" for name in names}


def own_heights():
    """The heights from a file, if the terrain is made of them."""
    return product_files(*{"elevation"}.intersection(pipeline.from_files(STUDY)))


def stage_inputs(name):
    stage = composition.STAGES[name]
    there = {*STAGES, *pipeline.from_files(STUDY)}
    given = [other for other in stage.optional if other in there]
    return product_files(*stage.inputs, *given)


def sources_of_chain(*products, script, library):
    """The files that take a study through the chain to some products."""
    stages = pipeline.needed(products).values()
    return sources_of(
        *library, *sorted({stage.module for stage in stages}), script=script
    )


def sweep_files(*names):
    """The files of sweeps, under the names by which the library finds them."""
    return {f"sweeps/{name}": f"<results>/sweeps/{name}.nc" for name in names}


def figure_jobs():
    """The figures to draw, by job: the panels of a sheet are drawn together."""
    jobs = {}
    # The design sheet can be asked for in any study.
    for name in dict.fromkeys([*STUDY.outputs.figures, "design"]):
        sheet = figures.FIGURES[name].sheet
        jobs.setdefault(f"{sheet}_panels" if sheet else name, []).append(name)
    return jobs


def figure_inputs(*names):
    products = {name for figure in names for name in figures.FIGURES[figure].inputs}
    read = {name for figure in names for name in figures.FIGURES[figure].sweeps}
    return product_files(*sorted(products)) | sweep_files(*sorted(read))


def figure_configuration(*names):
    return configuration(
        *{part for name in names for part in figures.FIGURES[name].sections}
    )


def figure_sources(*names):
    """The modules that declare figures, and what writes them to files."""
    modules = {figures.MODULES[name] for name in names}
    return sources_of(*sorted(modules), "figures.drawing.files", script="figures")


def figure_files(*names):
    """The files of figures; the report shows the PNG."""
    files = []
    for name in names:
        shown = dict(
            caption="../report/caption.rst", category="Figures", labels={"figure": name}
        )
        for suffix in STUDY.figures.formats:
            path = f"<results>/figures/{name}.{suffix}"
            files += [report(path, **shown) if suffix == "png" else path]
    return files


@cache
def checked_sweep(name):
    """A sweep, all of whose cases are valid: nothing runs if one is not."""
    try:
        sweep.studies(STUDY, name)
    except ConfigurationError as error:
        raise WorkflowError(str(error)) from None
    return STUDY.sweeps[name].model_dump(mode="json")


def sweep_sources(wildcards):
    if "accuracy" not in STAGES:
        refuse_without_truth("sweep", wildcards)
    return sources_of_chain(
        *sweep.results(STUDY, wildcards.sweep), script="sweep", library=["sweeps.sweep"]
    )


def sweep_configuration(wildcards):
    """What a sweep's cases read: not how figures look, where it runs, nor other sweeps."""
    checked = {"sweep": checked_sweep(wildcards.sweep)}
    return configuration(*sweep.declared(STUDY, wildcards.sweep)) | checked


def wanted_products():
    """The products that the study's outputs need, and the heights with their errors."""
    read = {
        name
        for figure in STUDY.outputs.figures
        for name in figures.FIGURES[figure].inputs
    }
    if STUDY.outputs.claims:
        read |= {*claims.inputs_of(STAGES)}
    read |= {"dem" if "dem" in STAGES else "images", "accuracy", "focus", "reflectors"}
    return list(pipeline.needed(read.intersection(STAGES), STAGES))


def shown_sweeps():
    """The sweeps that the study's figures show and its claims are decided on."""
    read = {
        name
        for figure in STUDY.outputs.figures
        for name in figures.FIGURES[figure].sweeps
    }
    if STUDY.outputs.claims:
        read |= {*claims.sweeps_of(STUDY)}
    return sorted(read)
