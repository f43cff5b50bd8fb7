"""The mechanism of the configuration: sections with described, bounded keys, and studies of them.

A section stands in the module whose options it holds; ``config/paper.yaml`` has every value, and
the models hold no defaults. `vinsar.study.composition` puts the sections together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, cast, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, field_validator

from vinsar.foundations.text import Name

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


_LEAST, _MOST = 1e-30, 1e30


def key(description: str, paper: str, **bounds: Any) -> Any:
    """Describe one key of a section.

    Parameters
    ----------
    description
        What it means.
    paper
        Where the paper gives it.
    bounds
        Of pydantic's ``Field``: ``gt``, ``ge``, ``lt``, ``le``, ``pattern``, ``default``.
    """
    return Field(description=description, json_schema_extra={"paper": paper}, **bounds)


class Section(BaseModel):
    """A part of the configuration that never changes and knows all its keys.

    ``class Filtering(Section, name="filtering")`` makes a section of a study; without a name it is
    a part of another one, such as an item of a list.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=True, validate_default=True
    )

    section_name: ClassVar[str] = ""

    @field_validator("*")
    @classmethod
    def _within_reason(cls, value: Any) -> Any:
        # Squares of what is larger, or smaller, are no numbers any more.
        if isinstance(value, float) and value != 0 and not _LEAST < abs(value) < _MOST:
            raise ValueError(f"must be 0 or from {_LEAST:g} to {_MOST:g} in size")
        return value

    def __init_subclass__(cls, name: str = "", **kwargs: Any) -> None:
        """Remember the section's name in a study."""
        super().__init_subclass__(**kwargs)
        cls.section_name = name


class Study(Section):
    """A study: its name, its seed, and the sections that `vinsar.study.composition` adds to it."""

    study: Name = key("name of the study; results go to results/<study>", "ours")
    seed: int = key("seed of everything random", "ours", ge=0)
    realization: int = key("number of the realization of everything random", "ours", ge=0)
    if TYPE_CHECKING:
        # Its sections, which the modules declare and vinsar.study composes.
        def __getattr__(self, name: str) -> Any: ...

    @classmethod
    def part(cls, values: Mapping[str, Any]) -> Study:
        """Return a study that has some of its parts and no others.

        A stage gets only the parts that it declares, so that it cannot depend on another unseen.

        Parameters
        ----------
        values
            Sections, as models or as plain values, by name; a name such as
            ``radar.frequency_count`` stands for a single key of a section.

        Returns
        -------
        Study
            Reading a part that is not there raises `AttributeError`.
        """
        parts: dict[str, Any] = {}
        single: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            section, _, key = name.partition(".")
            kind = cls.model_fields[section].annotation
            if key:
                single.setdefault(section, {})[key] = value
            elif isinstance(kind, type) and issubclass(kind, Section):
                parts[name] = kind.model_validate(value)
            elif isinstance(value, dict):
                parts[name] = TypeAdapter[Any](cast("Any", kind)).validate_python(value)
            else:
                parts[name] = value
        for section, keys in single.items():
            kind = cast("type[Section]", cls.model_fields[section].annotation)
            made = {
                # A list may hold models; plain values are what they are.
                key: TypeAdapter[Any](kind.model_fields[key].rebuild_annotation()).validate_python(
                    value
                )
                if isinstance(value, list)
                else value
                for key, value in keys.items()
            }
            parts[section] = kind.model_construct(**made)
        return cls.model_construct(**parts)

    def values(self, names: Iterable[str]) -> dict[str, Any]:
        """Return sections and single keys by name, as `part` takes them, in plain values."""
        result: dict[str, Any] = {}
        for name in names:
            section, _, key = name.partition(".")
            value = getattr(self, section)
            if key and isinstance(getattr(value, key), tuple):
                result[name] = value.model_dump(mode="json", include={key})[key]
                continue
            if key:
                value = getattr(value, key)
            if isinstance(value, dict):
                result[name] = {
                    label: item.model_dump(mode="json") if isinstance(item, Section) else item
                    for label, item in value.items()
                }
            else:
                plain = isinstance(value, Section)
                result[name] = value.model_dump(mode="json") if plain else value
        return result


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation names: those of a list's items, for example."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


def swept_section(study: Study, sweep: str, section: str) -> Any:
    """Return a section with the overrides that hold for all cases of a sweep.

    Parameters
    ----------
    study
        A study with this section and with ``sweeps``.
    sweep
        Name of the sweep.
    section
        Name of the section.

    Returns
    -------
    Section
        The section; what the sweep goes over is as in the study.
    """
    part = getattr(study, section)
    return part.model_copy(update=study.sweeps[sweep].base.get(section, {}))
