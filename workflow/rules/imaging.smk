# Range compression and back-projection.


rule profiles:
    input:
        received="<results>/received.nc",
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
        recorded_trajectory="<results>/recorded_trajectory.nc",
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


rule focus:
    input:
        true_trajectory="<results>/true_trajectory.nc",
        recorded_trajectory="<results>/recorded_trajectory.nc",
        code=stage_sources("focus"),
    output:
        "<results>/focus.nc",
    log:
        "<logs>/focus.log",
    benchmark:
        "<benchmarks>/focus.tsv"
    params:
        configuration=stage_configuration("focus"),
    script:
        "../scripts/stage.py"
