# From the two images to the unwrapped phase.


rule interferogram:
    input:
        images="<results>/images.nc",
        code=stage_sources("interferogram"),
    output:
        "<results>/interferogram.nc",
    log:
        "<logs>/interferogram.log",
    benchmark:
        "<benchmarks>/interferogram.tsv"
    params:
        configuration=stage_configuration("interferogram"),
    script:
        "../scripts/stage.py"


rule filtered:
    input:
        interferogram="<results>/interferogram.nc",
        code=stage_sources("filtered"),
    output:
        "<results>/filtered.nc",
    log:
        "<logs>/filtered.log",
    benchmark:
        "<benchmarks>/filtered.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("filtered"),
    script:
        "../scripts/stage.py"


rule unwrapped:
    input:
        filtered="<results>/filtered.nc",
        interferogram="<results>/interferogram.nc",
        trajectory="<results>/trajectory.nc",
        code=stage_sources("unwrapped"),
    output:
        "<results>/unwrapped.nc",
    log:
        "<logs>/unwrapped.log",
    benchmark:
        "<benchmarks>/unwrapped.tsv"
    params:
        configuration=stage_configuration("unwrapped"),
    script:
        "../scripts/stage.py"
