# From the unwrapped phase to heights and their errors.


rule dem:
    input:
        unwrapped="<results>/unwrapped.nc",
        images="<results>/images.nc",
        code=stage_sources("dem"),
    output:
        "<results>/dem.nc",
    log:
        "<logs>/dem.log",
    benchmark:
        "<benchmarks>/dem.tsv"
    params:
        configuration=stage_configuration("dem"),
    script:
        "../scripts/stage.py"


rule accuracy:
    input:
        dem="<results>/dem.nc",
        truth="<results>/truth.nc",
        code=stage_sources("accuracy"),
    output:
        "<results>/accuracy.nc",
    log:
        "<logs>/accuracy.log",
    benchmark:
        "<benchmarks>/accuracy.tsv"
    params:
        configuration=stage_configuration("accuracy"),
    script:
        "../scripts/stage.py"


rule baseline_angle:
    input:
        code=stage_sources("baseline_angle"),
    output:
        "<results>/baseline_angle.nc",
    log:
        "<logs>/baseline_angle.log",
    benchmark:
        "<benchmarks>/baseline_angle.tsv"
    params:
        configuration=stage_configuration("baseline_angle"),
    script:
        "../scripts/stage.py"


rule accuracy_summary:
    input:
        accuracy="<results>/accuracy.nc",
        code=sources_of("evaluation.accuracy", script="accuracy_summary"),
    output:
        report(
            "<results>/accuracy.json",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/accuracy_summary.log",
    benchmark:
        "<benchmarks>/accuracy_summary.tsv"
    params:
        configuration=configuration(),
        caption="Statistics of the height error in metres, for the whole scene, visible ground and "
        "shadow.",
    script:
        "../scripts/accuracy_summary.py"
