"""Tables in Markdown: written one way everywhere, and read back."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_RULES = {"l": "---", "r": "---:"}


def write(headings: Sequence[str], rows: Iterable[Sequence[str]], align: str = "") -> str:
    """Return a table in Markdown.

    Parameters
    ----------
    headings
        A heading for each column.
    rows
        Text by row and column.
    align
        A letter for each column, l(eft) or r(ight); all left by default.

    Returns
    -------
    str
        Its lines, without an end of line behind the last.

    Raises
    ------
    ValueError
        If a row or `align` has another number of columns than the headings.
    """
    rules = [_RULES[letter] for letter in align or "l" * len(headings)]
    table = [list(headings), *map(list, rows)]
    for row in [rules, *table]:
        if len(row) != len(headings):
            raise ValueError(
                f"{len(row)} cells in {row} for the {len(headings)} columns {headings}"
            )
    head, *body = (f"| {' | '.join(_escaped(cell) for cell in row)} |" for row in table)
    return "\n".join([head, f"|{'|'.join(rules)}|", *body])


def _escaped(cell: str) -> str:
    return " ".join(cell.replace("|", r"\|").split())


def read(text: str) -> list[tuple[str, ...]]:
    """Return the cells of the first table in a Markdown text, headings first.

    Parameters
    ----------
    text
        Any Markdown.

    Returns
    -------
    list of tuple of str
        Rows without the rule below the headings; empty if there is no table.
    """
    rows = []
    for line in text.splitlines():
        if line.startswith("|"):
            cells = line.strip().strip("|").replace(r"\|", "\0").split("|")
            rows.append(tuple(cell.strip().replace("\0", "|") for cell in cells))
        elif rows:
            break
    return [row for number, row in enumerate(rows) if number != 1]
