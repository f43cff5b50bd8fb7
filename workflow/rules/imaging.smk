# Range compression and back-projection.


rule profiles:
    input:
        echo="<results>/echo.nc",
        trajectory="<results>/trajectory.nc",
        code=stage_sources("profiles"),
    output:
        "<results>/profiles.nc",
    log:
        "<logs>/profiles.log",
    benchmark:
        "<benchmarks>/profiles.tsv"
    params:
        configuration=stage_configuration("profiles"),
    script:
        "../scripts/stage.py"


rule images:
    input:
        profiles="<results>/profiles.nc",
        trajectory="<results>/trajectory.nc",
        code=stage_sources("images"),
    output:
        "<results>/images.nc",
    log:
        "<logs>/images.log",
    benchmark:
        "<benchmarks>/images.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("images"),
    script:
        "../scripts/stage.py"
