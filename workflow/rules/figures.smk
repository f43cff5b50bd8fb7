# The figures, each as PDF, SVG and PNG; the panels of the third are drawn together. That of the design
# sheet can be asked for in any study.

for FIGURE in dict.fromkeys([*SINGLE, *(["fig3_panels"] if PANELS else []), "design"]):

    rule:
        name:
            f"figure_{FIGURE}"
        input:
            **figure_inputs(*drawn_as(FIGURE)),
            code=sources_of("figures", script="figures"),
        output:
            figure_files(*drawn_as(FIGURE), caption=f"../report/{FIGURE}.rst"),
        log:
            f"<logs>/figure_{FIGURE}.log",
        benchmark:
            f"<benchmarks>/figure_{FIGURE}.tsv"
        params:
            configuration=figure_configuration(*drawn_as(FIGURE)),
        script:
            "../scripts/figures.py"
