# The antennas, the true scene, and what of it the antennas see.


rule trajectory:
    input:
        code=stage_sources("trajectory"),
    output:
        "<results>/trajectory.nc",
    log:
        "<logs>/trajectory.log",
    benchmark:
        "<benchmarks>/trajectory.tsv"
    params:
        configuration=stage_configuration("trajectory"),
    script:
        "../scripts/stage.py"


rule true_trajectory:
    input:
        trajectory="<results>/trajectory.nc",
        code=stage_sources("true_trajectory"),
    output:
        "<results>/true_trajectory.nc",
    log:
        "<logs>/true_trajectory.log",
    benchmark:
        "<benchmarks>/true_trajectory.tsv"
    params:
        configuration=stage_configuration("true_trajectory"),
    script:
        "../scripts/stage.py"


rule recorded_trajectory:
    input:
        trajectory="<results>/trajectory.nc",
        code=stage_sources("recorded_trajectory"),
    output:
        "<results>/recorded_trajectory.nc",
    log:
        "<logs>/recorded_trajectory.log",
    benchmark:
        "<benchmarks>/recorded_trajectory.tsv"
    params:
        configuration=stage_configuration("recorded_trajectory"),
    script:
        "../scripts/stage.py"


rule roughness:
    input:
        code=stage_sources("roughness"),
    output:
        "<results>/roughness.nc",
    log:
        "<logs>/roughness.log",
    benchmark:
        "<benchmarks>/roughness.tsv"
    params:
        configuration=stage_configuration("roughness"),
    script:
        "../scripts/stage.py"


rule terrain:
    input:
        **own_heights(),
        roughness="<results>/roughness.nc",
        code=stage_sources("terrain"),
    output:
        "<results>/terrain.nc",
    log:
        "<logs>/terrain.log",
    benchmark:
        "<benchmarks>/terrain.tsv"
    params:
        configuration=stage_configuration("terrain"),
    script:
        "../scripts/stage.py"


rule facets:
    input:
        terrain="<results>/terrain.nc",
        code=stage_sources("facets"),
    output:
        "<results>/facets.nc",
    log:
        "<logs>/facets.log",
    benchmark:
        "<benchmarks>/facets.tsv"
    params:
        configuration=stage_configuration("facets"),
    script:
        "../scripts/stage.py"


rule visibility:
    input:
        terrain="<results>/terrain.nc",
        facets="<results>/facets.nc",
        true_trajectory="<results>/true_trajectory.nc",
        code=stage_sources("visibility"),
    output:
        "<results>/visibility.nc",
    log:
        "<logs>/visibility.log",
    benchmark:
        "<benchmarks>/visibility.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("visibility"),
    script:
        "../scripts/stage.py"


rule truth:
    input:
        terrain="<results>/terrain.nc",
        true_trajectory="<results>/true_trajectory.nc",
        code=stage_sources("truth"),
    output:
        "<results>/truth.nc",
    log:
        "<logs>/truth.log",
    benchmark:
        "<benchmarks>/truth.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("truth"),
    script:
        "../scripts/stage.py"
