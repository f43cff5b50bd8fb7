# The figures, each as PDF, SVG and PNG.


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


rule fig5:
    input:
        **figure_inputs("fig5"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("fig5", caption="../report/fig5.rst"),
    log:
        "<logs>/fig5.log",
    benchmark:
        "<benchmarks>/fig5.tsv"
    params:
        configuration=figure_configuration("fig5"),
    script:
        "../scripts/figures.py"


rule figure_baseline_length:
    input:
        **figure_inputs("baseline_length"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("baseline_length", caption="../report/baseline_length.rst"),
    log:
        "<logs>/figure_baseline_length.log",
    benchmark:
        "<benchmarks>/figure_baseline_length.tsv"
    params:
        configuration=figure_configuration("baseline_length"),
    script:
        "../scripts/figures.py"


rule figure_baseline_angle:
    input:
        **figure_inputs("baseline_angle"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("baseline_angle", caption="../report/baseline_angle.rst"),
    log:
        "<logs>/figure_baseline_angle.log",
    benchmark:
        "<benchmarks>/figure_baseline_angle.tsv"
    params:
        configuration=figure_configuration("baseline_angle"),
    script:
        "../scripts/figures.py"


rule figure_baseline_vibration:
    input:
        **figure_inputs("baseline_vibration"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("baseline_vibration", caption="../report/baseline_vibration.rst"),
    log:
        "<logs>/figure_baseline_vibration.log",
    benchmark:
        "<benchmarks>/figure_baseline_vibration.tsv"
    params:
        configuration=figure_configuration("baseline_vibration"),
    script:
        "../scripts/figures.py"


rule figure_snr:
    input:
        **figure_inputs("snr"),
        code=sources_of("figures", script="figures"),
    output:
        figure_files("snr", caption="../report/snr.rst"),
    log:
        "<logs>/figure_snr.log",
    benchmark:
        "<benchmarks>/figure_snr.tsv"
    params:
        configuration=figure_configuration("snr"),
    script:
        "../scripts/figures.py"
