# The stepped-frequency echo of the scene.


rule echo:
    input:
        facets="<results>/facets.nc",
        trajectory="<results>/trajectory.nc",
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
