# The paper's claims against this study's figures.


rule claims:
    input:
        **product_files(*claims.INPUTS),
        **sweep_files(*claims.SWEEPS),
        code=sources_of("claims", script="claims"),
    output:
        json=report(
            "<results>/claims.json",
            caption="../report/claims.rst",
            category="Claims",
        ),
        markdown="<results>/claims.md",
    log:
        "<logs>/claims.log",
    benchmark:
        "<benchmarks>/claims.tsv"
    params:
        configuration=configuration(*claims.SECTIONS),
    script:
        "../scripts/claims.py"


rule variants:
    input:
        code=sources_of("variants", script="variants"),
    output:
        report(
            "<results>/variants.md",
            caption="../report/variants.rst",
            category="Numbers",
        ),
    log:
        "<logs>/variants.log",
    benchmark:
        "<benchmarks>/variants.tsv"
    threads: workflow.cores
    params:
        configuration=STUDY.model_dump(mode="json"),
    script:
        "../scripts/variants.py"
