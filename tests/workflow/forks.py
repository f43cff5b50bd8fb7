"""Run commands of checkouts, each in a process forked from this one.

Most of a command's time it loads what others have written, which is done here, once. The checkout's
own library and scripts each command loads afresh. Tests of the launcher and of sweeps start theirs
as a shell does.
"""

import json
import os
import runpy
import sys

import dask  # noqa: F401
import matplotlib.colors  # noqa: F401
import netCDF4  # noqa: F401
import pydantic  # noqa: F401
import snakemake.cli  # noqa: F401
import xarray  # noqa: F401
import yte  # noqa: F401

for line in sys.stdin:
    told = json.loads(line)
    child = os.fork()
    if child == 0:
        for number, path in enumerate((os.devnull, *told["files"])):
            os.dup2(os.open(path, os.O_RDWR), number)
        os.chdir(told["folder"])
        os.environ.clear()
        os.environ.update(told["environment"])
        sys.path.insert(0, told["source"])
        sys.argv = told["command"]
        run = runpy.run_path if sys.argv[0].endswith(".py") else runpy.run_module
        run(sys.argv[0], run_name="__main__")
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)  # noqa: T201
