# Sweeps over keys of the configuration: results/<study>/sweeps/<name>.nc.
import re


rule sweep:
    input:
        **own_heights(),
        code=sweep_sources,
    output:
        "<results>/sweeps/{sweep}.nc",
    log:
        "<logs>/sweep_{sweep}.log",
    benchmark:
        "<benchmarks>/sweep_{sweep}.tsv"
    wildcard_constraints:
        sweep="|".join(map(re.escape, STUDY.sweeps)) or "(?!)",
    threads: workflow.cores
    params:
        configuration=sweep_configuration,
    script:
        "../scripts/sweep.py"
