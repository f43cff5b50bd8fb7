# Obstacles and holes on the heights, and how well they are found.


rule detections:
    input:
        dem="<results>/dem.nc",
        images="<results>/images.nc",
        interferogram="<results>/interferogram.nc",
        trajectory="<results>/trajectory.nc",
        code=stage_sources("detections"),
    output:
        "<results>/detections.nc",
    log:
        "<logs>/detections.log",
    benchmark:
        "<benchmarks>/detections.tsv"
    params:
        configuration=stage_configuration("detections"),
    script:
        "../scripts/stage.py"


rule detection_accuracy:
    input:
        detections="<results>/detections.nc",
        truth="<results>/truth.nc",
        code=stage_sources("detection_accuracy"),
    output:
        "<results>/detection_accuracy.nc",
    log:
        "<logs>/detection_accuracy.log",
    benchmark:
        "<benchmarks>/detection_accuracy.tsv"
    params:
        configuration=stage_configuration("detection_accuracy"),
    script:
        "../scripts/stage.py"


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
