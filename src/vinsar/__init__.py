"""Vehicle-mounted forward-looking interferometric SAR, from radar echoes to terrain height.

Each stage of the chain is a module with functions on labelled `xarray.Dataset` objects;
`vinsar.study.pipeline.run` takes a validated configuration through all of them in memory.
"""

__version__ = "0.1.0"
