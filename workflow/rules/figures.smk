# The figures, each as PDF, SVG and PNG.

for JOB, NAMES in figure_jobs().items():

    rule:
        name:
            f"figure_{JOB}"
        input:
            **figure_inputs(*NAMES),
            code=figure_sources(*NAMES),
        output:
            figure_files(*NAMES),
        log:
            f"<logs>/figure_{JOB}.log",
        benchmark:
            f"<benchmarks>/figure_{JOB}.tsv"
        params:
            configuration=figure_configuration(*NAMES),
            caption=figures.FIGURES[NAMES[0]].caption,
        script:
            "../scripts/figures.py"
