# The stages of the chain: a rule each, made from what the stages declare.

for NAME in [
    name for name in composition.STAGES if name not in pipeline.from_files(STUDY)
]:

    rule:
        name:
            NAME
        input:
            **stage_inputs(NAME),
            code=stage_sources(NAME),
        output:
            f"<results>/{NAME}.nc",
        log:
            f"<logs>/{NAME}.log",
        benchmark:
            f"<benchmarks>/{NAME}.tsv"
        threads: workflow.cores if composition.STAGES[NAME].parallel else 1
        params:
            configuration=stage_configuration(NAME),
        script:
            "../scripts/stage.py"
