# Files from elsewhere: heights for the terrain, or echoes in place of simulated ones.

if "elevation" in pipeline.from_files(STUDY):

    rule elevation:
        input:
            file=STUDY.scene.file,
            code=sources_of("study.ingest", script="ingest"),
        output:
            "<results>/elevation.nc",
        log:
            "<logs>/elevation.log",
        benchmark:
            "<benchmarks>/elevation.tsv"
        params:
            configuration=configuration(
                "measurement",
                "radar.rail_height_m",
                *[f"scene.{key}" for key in ELEVATION],
            ),
        script:
            "../scripts/ingest.py"


if STUDY.measurement.file is not None:

    rule measurement:
        input:
            file=STUDY.measurement.file,
            code=sources_of("study.ingest", script="ingest"),
        output:
            **product_files(*pipeline.MEASURED),
        log:
            "<logs>/measurement.log",
        benchmark:
            "<benchmarks>/measurement.tsv"
        params:
            configuration=configuration("measurement"),
        script:
            "../scripts/ingest.py"
