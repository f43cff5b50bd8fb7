# The study's numbers, the paper's claims against them, and its report.


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


rule detection_summary:
    input:
        **sweep_files(detection_accuracy.SWEEP),
        code=sources_of("evaluation.detection_accuracy", script="detection_summary"),
    output:
        report(
            "<results>/detection.md",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/detection_summary.log",
    benchmark:
        "<benchmarks>/detection_summary.tsv"
    params:
        configuration=configuration("scene", "detection", "sweeps"),
        caption="How many obstacles and holes are found, false alarms of the heights and of the "
        "image alone, and what is unknown.",
    script:
        "../scripts/detection_summary.py"


rule claims:
    input:
        **product_files(*claims.inputs_of(STAGES)),
        **sweep_files(*claims.sweeps_of(STUDY)),
        code=sources_of("paper.claims", script="claims"),
    output:
        json=report(
            "<results>/claims.json",
            caption="../report/caption.rst",
            category="Claims",
        ),
        markdown="<results>/claims.md",
    log:
        "<logs>/claims.log",
    benchmark:
        "<benchmarks>/claims.tsv"
    params:
        configuration=configuration(*claims.SECTIONS),
        caption="The paper's claims, what this study finds, and the verdict on each.",
    script:
        "../scripts/claims.py"


rule variants:
    input:
        **own_heights(),
        code=if_made(
            "accuracy",
            sources_of_chain(
                "accuracy", script="variants", library=["sweeps.variants"]
            ),
        ),
    output:
        report(
            "<results>/variants.md",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/variants.log",
    benchmark:
        "<benchmarks>/variants.tsv"
    threads: workflow.cores
    params:
        configuration=STUDY.model_dump(mode="json"),
        caption="Accuracy of the study beside variants of it: other seeds, rail heights and choices "
        "that the paper leaves open.",
    script:
        "../scripts/variants.py"


rule report:
    input:
        **product_files(*wanted_products()),
        **sweep_files(*shown_sweeps()),
        **{
            f"figures/{name}.{suffix}": f"<results>/figures/{name}.{suffix}"
            for name in STUDY.outputs.figures
            for suffix in STUDY.figures.formats
            if suffix in ("png", "pdf")
        },
        **({"claims.json": "<results>/claims.json"} if STUDY.outputs.claims else {}),
        **(
            {"accuracy.json": "<results>/accuracy.json"}
            if "accuracy" in wanted_products()
            else {}
        ),
        code=[
            *sources_of("report", *figures.MODULES.values(), script="report"),
            *[os.path.relpath(path) for path in study_report.TEMPLATES],
            "config/paper.yaml",
            "docs/errata.md",
        ],
    output:
        html="<results>/report.html",
        pdf="<results>/report.pdf",
    log:
        "<logs>/report.log",
    benchmark:
        "<benchmarks>/report.tsv"
    params:
        configuration=configuration(*study_report.SECTIONS),
    script:
        "../scripts/report.py"


rule design:
    input:
        code=sources_of("prediction.design", script="design"),
    output:
        "<results>/design.md",
    log:
        "<logs>/design.log",
    benchmark:
        "<benchmarks>/design.tsv"
    params:
        configuration=STUDY.model_dump(mode="json"),
    script:
        "../scripts/design.py"


rule systems:
    input:
        **sweep_files(systems.SWEEP),
        code=sources_of("prediction.systems", script="systems"),
    output:
        report(
            "<results>/systems.md",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/systems.log",
    benchmark:
        "<benchmarks>/systems.tsv"
    params:
        configuration=configuration("radar", "scene", "vehicle", "sweeps"),
        caption=figures.FIGURES["systems"].caption,
    script:
        "../scripts/systems.py"


rule registration_summary:
    input:
        **product_files("registered"),
        code=if_made(
            "registered",
            sources_of(
                "evaluation.registered", "paper.claims", script="registration_summary"
            ),
        ),
    output:
        report(
            "<results>/registered.md",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/registration_summary.log",
    benchmark:
        "<benchmarks>/registration_summary.tsv"
    params:
        configuration=configuration(),
        caption="Coherence, misregistration and heights of images that are registered or not, "
        "beside images focused on the surface.",
    script:
        "../scripts/registration_summary.py"


rule likeness:
    input:
        **sweep_files(*likeness.SWEEPS, likeness.POSITION_ERRORS),
        code=sources_of("paper.likeness", script="likeness"),
    output:
        report(
            "<results>/likeness.md",
            caption="../report/caption.rst",
            category="Numbers",
        ),
    log:
        "<logs>/likeness.log",
    benchmark:
        "<benchmarks>/likeness.tsv"
    params:
        configuration=configuration(),
        caption=figures.FIGURES["likeness"].caption,
    script:
        "../scripts/likeness.py"
