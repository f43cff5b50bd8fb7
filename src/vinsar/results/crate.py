"""A finished study as a Workflow Run RO-Crate, which tells anybody what was run and how.

The study's folder becomes the crate: ``ro-crate-metadata.json`` describes the workflow, each job
with its inputs, outputs, parameters and times, and the software, all from the study's records; the
sources and the whole configuration stand beside it. It keeps to the Process, Workflow and
Provenance Run Crate profiles, version 0.5.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rocrate.model import ContextEntity
from rocrate.model.computationalworkflow import ComputationalWorkflow
from rocrate.rocrate import ROCrate

from vinsar._version import __version__
from vinsar.foundations.configuration import Study
from vinsar.results import lineage, provenance, storage
from vinsar.results.lineage import SOURCE
from vinsar.study.options import Sweep

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

METADATA = "ro-crate-metadata.json"
CONFIGURATION = "configuration.yaml"
_WORKFLOW = f"{SOURCE}/Snakefile"

_PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
    "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
    "https://w3id.org/ro/wfrun/provenance/0.5": "Provenance Run Crate",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0": "Workflow RO-Crate",
}
_FORMATS = {
    ".nc": "application/x-netcdf",
    ".pdf": "application/pdf",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".html": "text/html",
    ".json": "application/json",
    ".md": "text/markdown",
    ".rst": "text/x-rst",
    ".yaml": "application/yaml",
    ".toml": "application/toml",
    ".cff": "application/yaml",
    ".py": "text/x-python",
}
_FOLDERS = {
    lineage.RECORDS: "what each result was made from, when, how long it took, and its SHA-256",
    "logs": "the jobs' messages",
    "benchmarks": "seconds and memory of each job",
}
# The oldest that a zip archive can tell: the same crate is then the same bytes.
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)

_Jobs = dict[str, list[dict[str, Any]]]


class _TypedWorkflow(ComputationalWorkflow):  # type: ignore[misc]
    # With steps, it is a HowTo as well.
    TYPES = ("File", "SoftwareSourceCode", "ComputationalWorkflow", "HowTo")

    def _empty(self) -> dict[str, Any]:
        return {"@id": self.id, "@type": list(self.TYPES)}


def write(folder: str | Path, study: Study, *, agent: str = "") -> Path:
    """Make a crate of a finished study: its metadata, its sources, and all of it in one archive.

    Parameters
    ----------
    folder
        The study's folder; ``ro-crate-metadata.json``, ``configuration.yaml`` and ``source`` are
        written into it.
    study
        Its configuration.
    agent
        Name of the person who ran it; nobody is named without.

    Returns
    -------
    Path
        The archive beside the folder, ``<folder>.crate.zip``.

    Raises
    ------
    ValueError
        If the study has not run to its end, or a result is modified, missing or stale.
    """
    folder = Path(folder)
    lineage.refuse_links(folder)
    if (folder / SOURCE).is_symlink():
        raise ValueError(f"{folder / SOURCE} is a link, where the sources are to be; remove it")
    _refuse_unsound(folder, study)
    records = lineage.read_records(folder)
    own = {name: _place(path) for name, path in lineage.own_files(folder, records).items()}
    jobs: _Jobs = {}
    for _, record in sorted(records.items()):
        jobs.setdefault(record["job"], []).append(record)
    _copy_sources(folder, own)
    with storage.atomic(folder / CONFIGURATION) as path:
        path.write_text(_as_yaml(study), encoding="utf-8")
    described = _Description(folder, study, jobs, own, agent).document()
    with storage.atomic(folder / METADATA) as path:
        text = json.dumps(described, indent=2, sort_keys=True, ensure_ascii=False)
        path.write_text(text + "\n", encoding="utf-8")
    archive = folder.with_name(f"{folder.name}.crate.zip")
    with storage.atomic(archive) as path:
        _zip(folder, path)
    return archive


def _refuse_unsound(folder: Path, study: Study) -> None:
    found = lineage.verify(folder, study)
    problems = [f"{name}: {text}" for name, texts in sorted(found.items()) for text in texts]
    # What is stale for it comes after what has changed.
    problems.sort(key=lambda text: ": stale" in text)
    if problems:
        more = f" and {len(problems) - 3} more" if len(problems) > 3 else ""
        raise ValueError(
            f"{folder} is not as its study left it ({'; '.join(problems[:3])}{more}); "
            f"run the study again, then make its crate"
        )
    wanted = {
        f"figures/{name}.{suffix}"
        for name in study.outputs.figures
        for suffix in study.figures.formats
    }
    # Measured echoes come without the truth that an accuracy needs.
    wanted |= {"accuracy.json"} if study.measurement.file is None else set()
    wanted |= {"claims.json"} if study.outputs.claims else set()
    missing = sorted(wanted - set(found))
    if missing:
        raise ValueError(
            f"{folder} lacks {', '.join(missing)}: the study has not run to its end; "
            "run it, then make its crate"
        )


def _place(path: Path) -> str:
    """Return where a file supplied by the user lies in the crate: where the sources look for it."""
    return f"{SOURCE}/own/{path.name}" if path.is_absolute() else f"{SOURCE}/{path.as_posix()}"


def _copy_sources(folder: Path, own: Mapping[str, str]) -> None:
    shutil.rmtree(folder / SOURCE, ignore_errors=True)
    copies = {folder / SOURCE / path: path for path in provenance.workflow_files()}
    copies |= {folder / place: folder / name for name, place in own.items()}
    for target, path in copies.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)


def _as_yaml(study: Study) -> str:
    import yaml

    values = yaml.safe_dump(study.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
    return (
        f"# All of the study's configuration: ./run --configfile {CONFIGURATION} computes it again."
        f"\n{values}"
    )


def _files(folder: Path) -> Iterator[str]:
    """Yield the crate's files but its metadata, by their paths in it."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in name.parts)
        if path.is_file() and not hidden and name.as_posix() != METADATA:
            yield name.as_posix()


def _zip(folder: Path, archive: Path) -> None:
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        for name in (f"{name}/" for name in _FOLDERS if (folder / name).is_dir()):
            file.writestr(_entry(name, 0o40755), b"")
        for name in (METADATA, *_files(folder)):
            executable = (folder / name).stat().st_mode & 0o100
            entry = _entry(name, 0o100755 if executable else 0o100644)
            with (folder / name).open("rb") as source, file.open(entry, "w") as target:
                shutil.copyfileobj(source, target)


def _entry(name: str, mode: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _ZIP_TIME)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = mode << 16
    return entry


class _Description:
    """The crate's entities, from the study's records."""

    def __init__(
        self,
        folder: Path,
        study: Study,
        jobs: _Jobs,
        own: Mapping[str, str],
        agent: str,
    ) -> None:
        self.folder, self.study, self.jobs, self.own = folder, study, jobs, own
        self.crate = ROCrate(version="1.1")
        self.records = [record for records in jobs.values() for record in records]
        self.started = min(record["started"] for record in self.records)
        self.ended = max(record["ended"] for record in self.records)
        self.agent = self._add("#agent", "Person", name=agent) if agent else None
        self.software = self._software()
        # Folders tell of what is in them, and the workflow is an entity of its own kind.
        self.files = {
            name: self._file(name)
            for name in _files(folder)
            if name.partition("/")[0] not in _FOLDERS and name != _WORKFLOW
        }
        self.parameters: dict[str, Any] = {}

    def document(self) -> dict[str, Any]:
        """Return the metadata document."""
        self._folders()
        outputs = {record["file"]: self._output(record) for record in self.records}
        given = {
            name: self._parameter(name, "File", "a file supplied by the user", self.files[place])
            for name, place in self.own.items()
        }
        values = {job: self._values(job) for job in self.jobs}
        rules = sorted({records[0]["rule"] for records in self.jobs.values()}, key=self._depth)
        tools = {rule: self._tool(rule, outputs | given, values) for rule in rules}
        configuration = self._parameter(
            "configuration", "File", "the study's whole configuration", self.files[CONFIGURATION]
        )
        workflow = self._workflow(
            tools,
            inputs=[configuration, *given.values(), *self.parameters.values()],
            outputs=list(outputs.values()),
        )
        steps = {}
        for position, (rule, tool) in enumerate(tools.items()):
            steps[rule] = self._add(
                f"#step/{rule}", "HowToStep", name=rule, position=position, workExample=tool
            )
        workflow["step"] = list(steps.values())
        jobs = [
            self._job(job, tools, values[job])
            for job in sorted(self.jobs, key=lambda job: (self.jobs[job][0]["started"], job))
        ]
        controls = [
            self._add(
                job.id.replace("#job/", "#control/"),
                "ControlAction",
                name=f"{job['name']} is run",
                instrument=steps[self.jobs[job["name"]][0]["rule"]],
                object=job,
                **self._by_agent(),
            )
            for job in jobs
        ]
        run = self._action(
            "#run",
            name=f"the study '{self.study.study}'",
            description=f"all results of {self.study.study}, from the first job to the last",
            instrument=workflow,
            object=[
                self.files[CONFIGURATION],
                *(self.files[place] for place in self.own.values()),
                *_distinct(values.values()),
            ],
            result=[self.files[record["file"]] for record in self.records],
            started=self.started,
            ended=self.ended,
        )
        organized = self._add(
            "#organization",
            "OrganizeAction",
            name=f"Snakemake runs the study '{self.study.study}'",
            instrument=self.software["snakemake"],
            object=controls,
            result=run,
            startTime=self.started,
            endTime=self.ended,
            **self._by_agent(),
        )
        self._root(workflow, mentions=[run, organized, *jobs])
        whole = dict(self.crate.metadata.generate())
        whole["@graph"] = [
            # RO-Crate 1.1 asks for a single value rather than a list of one.
            {key: value[0] if _is_single(value) else value for key, value in entity.items()}
            for entity in whole["@graph"]
        ]
        return whole

    def _add(self, identifier: str, kind: str, /, **properties: Any) -> Any:
        properties = {"@type": kind, **properties}
        return self.crate.add(ContextEntity(self.crate, identifier, properties=properties))

    def _by_agent(self) -> dict[str, Any]:
        return {"agent": self.agent} if self.agent is not None else {}

    def _software(self) -> dict[str, Any]:
        """Add what computed, with its versions: the libraries, Python and the workflow engine."""
        versions = json.loads(self.records[0]["provenance"]["vinsar_libraries"])
        versions |= {
            "Python": self.records[0]["python"],
            "snakemake": metadata.version("snakemake"),
        }
        homes = {"Python": "https://www.python.org/"}
        return {
            name: self._add(
                f"#software/{name}",
                "SoftwareApplication",
                name=name,
                version=version,
                softwareVersion=version,
                url=homes.get(name, f"https://pypi.org/project/{name}/"),
            )
            for name, version in sorted(versions.items())
        }

    def _file(self, name: str) -> Any:
        path = self.folder / name
        properties = {"name": path.name, **_size_and_kind(path)}
        if path.suffix == ".py" or path.name == "run":
            properties["@type"] = ["File", "SoftwareSourceCode"]
            properties["programmingLanguage"] = self.software["Python"]
        return self.crate.add_file(dest_path=name, properties=properties)

    def _folders(self) -> None:
        for name, description in _FOLDERS.items():
            if (self.folder / name).is_dir():
                properties = {"name": name, "description": description}
                self.crate.add_dataset(dest_path=f"{name}/", properties=properties)

    def _parameter(self, name: str, kind: str, description: str, *examples: Any) -> Any:
        """Add what may be given to, or comes out of, the workflow and its tools."""
        parameter = self._add(
            f"#parameter/{name}",
            "FormalParameter",
            name=name,
            additionalType=kind,
            description=description,
            conformsTo={"@id": "https://bioschemas.org/profiles/FormalParameter/1.0-RELEASE"},
            workExample=list(examples),
        )
        for example in examples:
            example["exampleOfWork"] = parameter
        return parameter

    def _output(self, record: Mapping[str, Any]) -> Any:
        file = self.files[record["file"]]
        parameter = self._parameter(record["file"], "File", f"made by {record['rule']}", file)
        parameter["encodingFormat"] = file["encodingFormat"]
        return parameter

    def _values(self, job: str) -> list[Any]:
        """Add the values of the configuration that a job reads."""
        attributes = self.jobs[job][0]["provenance"]
        found = []
        for key, value in lineage.leaves(json.loads(attributes["vinsar_configuration"])):
            # Each sweep has its own definition under the same key.
            name = key.replace("sweep.", f"sweeps.{job.rsplit(maxsplit=1)[-1]}.", 1)
            name = name if key.startswith("sweep.") else key
            plain = value if isinstance(value, str | int | float) else json.dumps(value)
            if name not in self.parameters:
                given = self._add(f"#value/{name}", "PropertyValue", name=name, value=plain)
                self.parameters[name] = self._parameter(name, _kind(value), _meaning(key), given)
            found.append(self.crate.dereference(f"#value/{name}"))
        return found

    def _tool(self, rule: str, files: Mapping[str, Any], values: Mapping[str, list[Any]]) -> Any:
        jobs = [job for job, records in self.jobs.items() if records[0]["rule"] == rule]
        records = [record for job in jobs for record in self.jobs[job]]
        attributes = records[0]["provenance"]
        read = sorted({name for record in records for name in record["inputs"].values()})
        given = [value["exampleOfWork"] for value in _distinct(values[job] for job in jobs)]
        code = sorted({name for record in records for name in _json(record, "vinsar_code")})
        return self._add(
            f"#tool/{rule}",
            "SoftwareApplication",
            name=f"vinsar {rule}",
            version=__version__,
            softwareVersion=f"{attributes['source']}, commit {attributes['vinsar_commit']}",
            input=[*(files[name] for name in read), *given],
            output=[files[record["file"]] for record in records],
            hasPart=[self.files[f"{SOURCE}/{name}"] for name in code],
            softwareRequirements=list(self.software.values()),
        )

    def _workflow(self, tools: Mapping[str, Any], *, inputs: list[Any], outputs: list[Any]) -> Any:
        return self.crate.add_workflow(
            dest_path=_WORKFLOW,
            main=True,
            lang="snakemake",
            lang_version=metadata.version("snakemake"),
            cls=_TypedWorkflow,
            properties={
                "name": "vinsar: forward-looking InSAR from raw echoes to heights",
                **_size_and_kind(self.folder / _WORKFLOW),
                "version": __version__,
                "license": {"@id": _license()["@id"]},
                "conformsTo": {
                    "@id": "https://bioschemas.org/profiles/ComputationalWorkflow/1.0-RELEASE"
                },
                "hasPart": list(tools.values()),
                "input": inputs,
                "output": outputs,
                "softwareRequirements": list(self.software.values()),
            },
        )

    def _job(self, job: str, tools: Mapping[str, Any], values: list[Any]) -> Any:
        """Add what a job did."""
        records = self.jobs[job]
        read = sorted({name for record in records for name in record["inputs"].values()})
        return self._action(
            f"#job/{job.replace(' ', '/')}",
            name=job,
            description=f"on {_cores(records[0]['threads'])} of {records[0]['platform']}",
            instrument=tools[records[0]["rule"]],
            object=[*(self.files[self.own.get(name, name)] for name in read), *values],
            result=[self.files[record["file"]] for record in records],
            started=min(record["started"] for record in records),
            ended=max(record["ended"] for record in records),
        )

    def _action(self, identifier: str, *, started: str, ended: str, **properties: Any) -> Any:
        return self._add(
            identifier,
            "CreateAction",
            startTime=started,
            endTime=ended,
            actionStatus="http://schema.org/CompletedActionStatus",
            **properties,
            **self._by_agent(),
        )

    def _depth(self, rule: str) -> tuple[int, str]:
        """Return how many steps come before a rule's at least: an order of the steps."""
        made_by = {record["file"]: record for record in self.records}

        def below(name: str) -> int:
            sources = set(made_by[name]["inputs"].values()) - set(self.own)
            return max((1 + below(source) for source in sources), default=0)

        return max(below(record["file"]) for record in self.records if record["rule"] == rule), rule

    def _root(self, workflow: Any, *, mentions: list[Any]) -> None:
        root = self.crate.root_dataset
        commits = sorted({record["provenance"]["vinsar_commit"] for record in self.records})
        root["name"] = f"vinsar study '{self.study.study}'"
        root["description"] = (
            "A simulated study of a vehicle-mounted forward-looking interferometric SAR, from raw "
            f"echoes to heights: its datasets, figures and claims, made by vinsar "
            f"{__version__} (commit {', '.join(commits)}), with its sources and "
            f"configuration. To compute it again: cd {SOURCE} && ./run --configfile "
            f"../{CONFIGURATION}"
        )
        root["datePublished"] = self.ended
        root["license"] = self._license_entity()
        root["mentions"] = mentions
        root["conformsTo"] = [
            self._add(profile, "CreativeWork", name=name, version=profile.rsplit("/", 1)[-1])
            for profile, name in _PROFILES.items()
        ]
        cited = _citation_file()
        authors = [
            self._add(f"#author/{number}", "Organization", name=author["name"])
            for number, author in enumerate(cited["authors"])
        ]
        workflow["creator"] = authors
        root["author"] = [self.agent] if self.agent is not None else authors
        root["citation"] = [
            self._article(f"#citation/{number}", reference)
            for number, reference in enumerate(cited["references"])
        ]

    def _license_entity(self) -> Any:
        described = _license()
        return self._add(described.pop("@id"), "CreativeWork", **described)

    def _article(self, identifier: str, reference: Mapping[str, Any]) -> Any:
        journal = self._add(f"{identifier}/journal", "Periodical", name=reference["journal"])
        volume = self._add(
            f"{identifier}/volume",
            "PublicationVolume",
            volumeNumber=str(reference["volume"]),
            isPartOf=journal,
        )
        authors = [
            self._add(f"{identifier}/author/{number}", "Organization", name=author["name"])
            for number, author in enumerate(reference["authors"])
        ]
        return self._add(
            identifier,
            "ScholarlyArticle",
            name=reference["title"],
            author=authors,
            datePublished=str(reference["year"]),
            isPartOf=volume,
        )


def _size_and_kind(path: Path) -> dict[str, Any]:
    return {
        "sha256": provenance.sha256(path),
        "contentSize": str(path.stat().st_size),
        "encodingFormat": _FORMATS.get(path.suffix, "text/plain"),
    }


def _distinct(lists: Iterable[list[Any]]) -> list[Any]:
    return list({entity.id: entity for entities in lists for entity in entities}.values())


def _is_single(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 1


def _json(record: Mapping[str, Any], attribute: str) -> Any:
    return json.loads(record["provenance"][attribute])


def _cores(count: int) -> str:
    return "1 core" if count == 1 else f"{count} cores"


def _kind(value: Any) -> str:
    # bool before int, which it is.
    kinds = {bool: "Boolean", int: "Integer", float: "Float"}
    return next((name for kind, name in kinds.items() if isinstance(value, kind)), "Text")


def _meaning(key: str) -> str:
    """Return what a key of the configuration means, or the part of it that is declared."""
    model: Any = Sweep if key.startswith("sweep.") else Study
    meaning = ""
    for part in key.removeprefix("sweep.").split("."):
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            break
        model, meaning = field.annotation, field.description or model.__doc__ or ""
    return meaning or key


def _citation_file() -> dict[str, Any]:
    import yaml

    return dict(yaml.safe_load(Path("CITATION.cff").read_text(encoding="utf-8")))


def _license() -> dict[str, str]:
    name = _citation_file()["license"]
    return {"@id": f"https://spdx.org/licenses/{name}", "name": name, "identifier": name}
