# How far the two images shift against each other (Fig. 2).


rule registration:
    input:
        trajectory="<results>/trajectory.nc",
        code=stage_sources("registration"),
    output:
        "<results>/registration.nc",
    log:
        "<logs>/registration.log",
    benchmark:
        "<benchmarks>/registration.tsv"
    threads: workflow.cores
    params:
        configuration=stage_configuration("registration"),
    script:
        "../scripts/stage.py"
