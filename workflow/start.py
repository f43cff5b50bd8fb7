"""Start Snakemake for ./run: check what it is given before, and what it has left afterwards.

Snakemake is started in this process, with five of its habits changed: it runs no code that stands
in a YAML file, it quotes the path of Python, its jobs fork from a process that has loaded the
library, it asks a cluster as often as it is told to, and it is told which results do not hold.
"""

import functools
import hashlib
import multiprocessing.connection
import os
import re
import subprocess
import sys
import threading
import types
from pathlib import Path

import yte
from snakemake import cli
from snakemake.benchmark import benchmarked
from snakemake.resources import Resource
from snakemake.script import PythonScript
from snakemake.workflow import Workflow
from snakemake_interface_executor_plugins.executors.remote import RemoteExecutor

from vinsar import results
from vinsar.foundations import strict_yaml
from vinsar.results import lineage

ROUNDS = 3
ROUND = "VINSAR_ROUND"
ENDS_OF_FILES = (".yaml", ".yml", ".json")
CONFIGFILE = ("--configfile", "--configfiles")
CONFIG = ("--config", "-C")
# What most jobs load, with the modules that xarray and Matplotlib load on their first use.
LOADED = [
    "snakemake.cli", "yte", "vinsar.figures", "vinsar.paper.claims", "vinsar.results.lineage",
    "vinsar.study.pipeline", "vinsar.sweeps.sweep", "netCDF4", "dask.array", "distributed",
    "matplotlib.backends.backend_agg", "scipy.optimize", "scipy.signal", "numba",
]  # fmt: skip


def main(arguments):
    """Check, run, check again; return the exit code."""
    arguments = targets_last(arguments)
    yte.process_yaml = read_profile
    parser, options = cli.parse_args(arguments)
    check_configuration(options)
    if options.executor not in (None, "local", "dryrun", "touch"):
        refuse_unquotable()
    if options.executor == "slurm":
        suit_cluster(options)
    if not options.dryrun:
        refuse_read_only(".snakemake", results.FOLDER)
    quote_interpreter()
    if not options.dryrun:
        fork_jobs()
    workflows = follow_workflows()
    done = cli.args_to_api(options, parser)
    for workflow in workflows:
        unsound = find_unsound(workflow)
        if unsound and done and not workflow.dryrun:
            return make_again(arguments, unsound)
        for name, problems in unsound.items():
            # Of a run that failed, much is stale or missing.
            if done or not problems[0].startswith(("stale", "missing")):
                say(f"{name} does not hold: {problems[0]}; the next ./run makes it again")
    return 0 if done else 1


def targets_last(arguments):
    """Move targets that stand behind a configuration behind ``--``, or it would swallow them."""
    kept, targets, belongs, last = [], [], None, False
    for argument in arguments:
        if last:
            targets.append(argument)
        elif argument == "--":
            last = True
        elif argument.startswith("-"):
            belongs = "file" if argument in CONFIGFILE else "value" if argument in CONFIG else None
            kept.append(argument)
        elif (belongs == "more files" and not is_configuration(argument)) or (
            belongs == "value" and "=" not in argument
        ):
            targets.append(argument)
        else:
            kept.append(argument)
            belongs = "more files" if belongs == "file" else belongs
    return [*kept, "--", *targets] if targets else kept


def is_configuration(argument):
    """Tell a configuration file from a target."""
    path = Path(argument)
    result = path.parts[:1] == (results.FOLDER,) and path.suffix == ".json"
    return path.suffix in ENDS_OF_FILES and not result


def read_profile(stream, **_):
    """Read what Snakemake reads as YAML, without running any of it."""
    try:
        return strict_yaml.load(stream.name)
    except strict_yaml.FileError as error:
        fail(error)


def check_configuration(options):
    """Refuse files that cannot be read whole, and a study that would take the paper's place."""
    values = [entry.partition("=")[0] for entry in options.config or ()]
    if strict_yaml.CODE in values:
        fail(f"{strict_yaml.CODE} would run the configuration as a program")
    try:
        if "study" in values or options.replace_workflow_config:
            for path in options.configfile:
                strict_yaml.load(path)
        else:
            strict_yaml.overrides(*options.configfile)
    except strict_yaml.FileError as error:
        fail(f"{error} (paths begin in {Path.cwd()})")
    if values and "study" not in values and not options.configfile:
        fail("--config does not name its study (study=...): the results would be the paper's")


def quote_interpreter():
    """Let Snakemake quote the path of Python, which it starts by a shell."""
    execute = PythonScript._execute_cmd

    @functools.wraps(execute)
    def quoting(self, command, **options):
        return execute(self, command.replace("{py_exec}", "{py_exec:q}"), **options)

    PythonScript._execute_cmd = quoting


def fork_jobs():
    """Let jobs fork from a process that has loaded what they need: most work takes less time.

    Its linear algebra has one thread, which cannot be changed later: stages of several threads
    share their work out themselves.
    """
    execute = PythonScript._execute_cmd
    loaded = digests_of_library()
    forks = multiprocessing.get_context("forkserver")
    forks.set_forkserver_preload(LOADED)
    os.environ.update({f"{library}_NUM_THREADS": "1" for library in ("OMP", "MKL", "OPENBLAS")})
    turn = threading.Lock()

    @functools.wraps(execute)
    def forking(self, command, *, fname=None, **options):
        elsewhere = fname is None or self.container_img or self.conda_env or self.env_modules
        if elsewhere or digests_of_library() != loaded:
            return execute(self, command, fname=fname, **options)
        job = forks.Process(target=run_script, args=(fname, self.resources.get("tmpdir"), loaded))
        try:
            # One at a time: each start asks whether the others have ended, too.
            with turn:
                job.start()
        except OSError:
            # Such as a folder for temporary files whose path is too long for a socket.
            return execute(self, command, fname=fname, **options)
        with benchmarked(job.pid, self.bench_record):
            multiprocessing.connection.wait([job.sentinel])
        with turn:
            job.join()
        if job.exitcode:
            raise subprocess.CalledProcessError(job.exitcode, [sys.executable, fname])
        return None

    PythonScript._execute_cmd = forking


def digests_of_library():
    """Return the digest of each file of the library, by the path that jobs know it by."""
    library = Path(results.__file__).parents[1]
    return {
        os.path.relpath(path): hashlib.sha256(path.read_bytes()).digest()
        for path in library.rglob("*.py")
    }


def run_script(path, temporary, loaded):
    """Run a script as Python would, in a process that has loaded some of it."""
    if temporary:
        os.environ.update(dict.fromkeys(("TMPDIR", "TMP", "TEMPDIR", "TEMP"), temporary))
    sys.argv = [path]
    main = types.ModuleType("__main__")
    main.__file__, main.loaded = path, loaded
    sys.modules["__main__"] = sys.modules["__mp_main__"] = main
    exec(compile(Path(path).read_bytes(), path, "exec"), vars(main))  # noqa: S102


def refuse_unquotable():
    """Refuse a folder in which the jobs of a cluster could not start Python."""
    odd = sorted({c for c in sys.executable if not (c.isalnum() or c in "/._-+@%:,=")})
    if odd:
        shown = " ".join("space" if c == " " else c for c in odd)
        fail(f"jobs of a cluster cannot start in a folder whose path has {shown}: {Path.cwd()}")


def suit_cluster(options):
    """Take as many cores a job as a node has, and ask SLURM in a way that it can answer."""
    asked = options.default_resources or {}
    chosen = str(asked["slurm_partition"].value) if "slurm_partition" in asked else None
    nodes = []
    for line in answer_of("sinfo", "-h", "-o", "%P %c %m").splitlines():
        partition, cores, memory = line.split()
        if chosen in (None, partition.rstrip("*")) and (chosen or partition.endswith("*")):
            nodes.append((int(cores.rstrip("+")), int(memory.rstrip("+"))))
    if not nodes:
        named = f"partition {chosen}" if chosen else "default partition; name one (slurm_partition)"
        fail(f"SLURM has no {named}")
    cores, memory = max(nodes)
    options.cores = options.cores or cores
    options.max_threads = min(options.max_threads or cores, cores)
    # A job that asks for more than a node has waits for ever.
    least = int(0.95 * memory) // cores
    if "mem_mb_per_cpu" in asked and int(asked["mem_mb_per_cpu"].value) > least:
        asked["mem_mb_per_cpu"] = Resource("mem_mb_per_cpu", least)
    if not isinstance(options.slurm_status_command, str):
        kept = answer_of("scontrol", "show", "config")
        accounted = re.search(r"^AccountingStorageType *= *(\S+)", kept, re.MULTILINE)
        none = accounted is None or accounted[1] in ("(null)", "accounting_storage/none")
        options.slurm_status_command = "squeue" if none else "sacct"
    # The executor would wait 10 s longer each time that no job has ended, up to 3 min, and a chain
    # of short jobs for most of its time. What the profile says is kept to.
    RemoteExecutor.next_seconds_between_status_checks = property(
        lambda self: self.workflow.remote_execution_settings.seconds_between_status_checks,
        lambda *_: None,
    )


def answer_of(*command):
    """Return what a command of SLURM's says."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    except FileNotFoundError:
        fail(f"there is no {command[0]} here; ./run --workflow-profile profiles/slurm asks SLURM")
    if done.returncode:
        fail(f"SLURM does not answer: {done.stderr.strip()}")
    return done.stdout


def refuse_read_only(*folders):
    """Refuse folders in which nothing can be written."""
    for folder in folders:
        place = Path(folder).absolute()
        while not place.exists():
            place = place.parent
        if not os.access(place, os.W_OK | os.X_OK):
            fail(f"{place} cannot be written; results and what Snakemake knows of them go there")


def follow_workflows():
    """Return a list that gets each workflow which Snakemake executes."""
    followed = []
    execute = Workflow.execute

    @functools.wraps(execute)
    def following(self, *arguments, **options):
        followed.append(self)
        return execute(self, *arguments, **options)

    Workflow.execute = following
    return followed


def find_unsound(workflow):
    """Return what is wrong with results that Snakemake left or takes to be up to date."""
    study = workflow.globals.get("STUDY")
    if study is None or workflow._dag is None:
        return {}
    jobs = set(workflow.dag.jobs)
    if workflow.dryrun:
        jobs -= set(workflow.dag.needrun_jobs())
    folder = results.folder(study.study)
    made = {Path(path) for job in jobs for path in job.output}
    names = [path.relative_to(folder).as_posix() for path in made if path.is_relative_to(folder)]
    found = lineage.unsound(folder, study, names)
    return {(folder / name).as_posix(): problems for name, problems in found.items()}


def make_again(arguments, unsound):
    """Run Snakemake again, for the results that do not hold."""
    number = int(os.environ.get(ROUND, "1"))
    for name, problems in sorted(unsound.items()):
        say(f"{name} does not hold: {problems[0]}")
    if number >= ROUNDS:
        fail(f"these results do not hold though they were made {number} times")
    say("they are made again")
    os.environ[ROUND] = str(number + 1)
    command = [sys.executable, "-P", __file__, "--forcerun", *unsound, "--rerun-incomplete"]
    os.execv(sys.executable, [*command, *arguments])  # noqa: S606


def say(message):
    """Print one line about the run."""
    sys.stderr.write(f"vinsar: {message}\n")


def fail(message):
    """End with a sentence instead of a traceback."""
    sys.exit(f"vinsar: {message}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
