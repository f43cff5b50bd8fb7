# The paper's figures, each as PDF, SVG and PNG.
PANELS = [
    name for name in figures.FIGURES if name.startswith("fig3") and name != "fig3"
]


def figure_inputs(*names):
    products = {name for figure in names for name in figures.FIGURES[figure].inputs}
    return {name: f"<results>/{name}.nc" for name in sorted(products)}


def figure_configuration(*names):
    return configuration(
        *{part for name in names for part in figures.FIGURES[name].sections}
    )


def figure_files(*names, caption):
    """The files of figures; the report shows the PNG."""
    shown = dict(caption=caption, category="Figures")
    files = []
    for name in names:
        stem = f"<results>/figures/{name}"
        png = report(f"{stem}.png", labels={"figure": name}, **shown)
        files += [f"{stem}.pdf", f"{stem}.svg", png]
    return files


rule fig1:
    input:
        **figure_inputs("fig1"),
        code=sources_of("figures"),
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
        code=sources_of("figures"),
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
        code=sources_of("figures"),
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
        code=sources_of("figures"),
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
        code=sources_of("figures"),
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
