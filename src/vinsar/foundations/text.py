"""Text from elsewhere (files, attributes, names), safe to show."""

from __future__ import annotations

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
