"""Text from elsewhere (files, attributes, names), safe to show."""

from __future__ import annotations

from typing import Annotated

from pydantic import StringConstraints

NAMED_BY = "1 to 80 letters, digits, spaces and any of _ . , + -, a letter or digit first and last"
"""How studies, sweeps and variants may be named: it is safe in paths, workflows and pages."""

Name = Annotated[
    str,
    StringConstraints(
        pattern=r"^[A-Za-z0-9]([A-Za-z0-9 _.,+-]*[A-Za-z0-9])?$", min_length=1, max_length=80
    ),
]
"""A name of that kind."""

_ASCII = str.maketrans({"─": "-", "│": "|", "├": "+", "└": "+"})


def printable(text: str, *, lines: bool = False) -> str:
    """Return text whose control characters are written out: a terminal would obey them.

    Parameters
    ----------
    text
        Any text.
    lines
        Whether ends of lines may stay.

    Returns
    -------
    str
        Text of printable characters alone.
    """
    return "".join(
        one if one.isprintable() or (lines and one == "\n") else repr(one)[1:-1] for one in text
    )


def fitting(text: str, encoding: str | None) -> str:
    """Return text that an encoding has all characters for, such as that of a terminal."""
    encoding = encoding or "ascii"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return text.translate(_ASCII).encode(encoding, "backslashreplace").decode(encoding)
    return text
