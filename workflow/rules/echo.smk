# The stepped-frequency echo of the scene.


rule echo:
    input:
        facets="<results>/facets.nc",
        true_trajectory="<results>/true_trajectory.nc",
        visibility="<results>/visibility.nc",
        code=stage_sources("echo"),
    output:
        "<results>/echo.nc",
    log:
        "<logs>/echo.log",
    benchmark:
        "<benchmarks>/echo.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("echo"),
    script:
        "../scripts/stage.py"


rule received:
    input:
        echo="<results>/echo.nc",
        facets="<results>/facets.nc",
        trajectory="<results>/trajectory.nc",
        code=stage_sources("received"),
    output:
        "<results>/received.nc",
    log:
        "<logs>/received.log",
    benchmark:
        "<benchmarks>/received.tsv"
    params:
        configuration=stage_configuration("received"),
    script:
        "../scripts/stage.py"


rule coupling:
    input:
        trajectory="<results>/trajectory.nc",
        echo="<results>/echo.nc",
        received="<results>/received.nc",
        code=stage_sources("coupling"),
    output:
        "<results>/coupling.nc",
    log:
        "<logs>/coupling.log",
    benchmark:
        "<benchmarks>/coupling.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("coupling"),
    script:
        "../scripts/stage.py"
