# The paper's figures, each as PDF, SVG and PNG.


rule fig1:
    input:
        **figure_inputs("fig1"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("fig1", caption="../report/fig1.rst"),
    log:
        "<logs>/fig1.log",
    benchmark:
        "<benchmarks>/fig1.tsv"
    params:
        configuration=figure_configuration("fig1"),
    script:
        "../scripts/figures.py"


rule fig2:
    input:
        **figure_inputs("fig2"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("fig2", caption="../report/fig2.rst"),
    log:
        "<logs>/fig2.log",
    benchmark:
        "<benchmarks>/fig2.tsv"
    params:
        configuration=figure_configuration("fig2"),
    script:
        "../scripts/figures.py"


rule fig3:
    input:
        **figure_inputs("fig3"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("fig3", caption="../report/fig3.rst"),
    log:
        "<logs>/fig3.log",
    benchmark:
        "<benchmarks>/fig3.tsv"
    params:
        configuration=figure_configuration("fig3"),
    script:
        "../scripts/figures.py"


rule fig3_panels:
    input:
        **figure_inputs(*PANELS),
        code=sources_of("figures", script="figures"),
    output:
        figure_files(*PANELS, caption="../report/fig3_panels.rst"),
    log:
        "<logs>/fig3_panels.log",
    benchmark:
        "<benchmarks>/fig3_panels.tsv"
    params:
        configuration=figure_configuration(*PANELS),
    script:
        "../scripts/figures.py"


rule fig4:
    input:
        **figure_inputs("fig4"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("fig4", caption="../report/fig4.rst"),
    log:
        "<logs>/fig4.log",
    benchmark:
        "<benchmarks>/fig4.tsv"
    params:
        configuration=figure_configuration("fig4"),
    script:
        "../scripts/figures.py"
