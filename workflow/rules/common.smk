# The checked configuration, and what a rule takes of it.
import os

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

from vinsar import claims, figures, pipeline, provenance, validation

SUFFIXES = ("pdf", "svg", "png")

try:
    STUDY = validation.check(config)
except validation.ConfigurationError as error:
    raise WorkflowError(str(error)) from None

for sentence in validation.advice(STUDY):
    logger.warning(f"Configuration: {sentence}")


def configuration(*sections):
    """The sections of the configuration that a rule reads, so that no other reruns it."""
    values = STUDY.model_dump(mode="json", include={"study", *sections})
    return dict(sorted(values.items()))


def sources_of(*modules):
    """The library's files that a rule runs: Snakemake follows scripts, not what they import."""
    return [os.path.relpath(path) for path in provenance.sources_of(*modules)]


def stage_configuration(name):
    return configuration(*pipeline.STAGES[name].sections)


def stage_sources(name):
    # The pipeline binds the configuration to the stage; what else it imports is not run.
    return [
        *sources_of(*pipeline.STAGES[name].modules),
        os.path.relpath(pipeline.__file__),
    ]
