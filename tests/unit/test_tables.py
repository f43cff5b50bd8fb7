"""Tables in Markdown: what is written is read back, whatever is in the cells."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations import tables

CELL = st.text(alphabet="ab|-: 0.%°", max_size=6).map(lambda text: " ".join(text.split()))


@given(st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(CELL, min_size=n, max_size=n),
                                                    min_size=1, max_size=4)))  # fmt: skip
def test_a_table_is_read_back_as_it_was_written(cells):
    headings, *rows = cells
    assert tables.read(tables.write(headings, rows)) == [tuple(row) for row in cells]


def test_a_table_is_written_with_its_alignment():
    text = tables.write(("a", "b"), [("1", "`x`"), ("2", "y\nz")], "lr")
    assert text == "| a | b |\n|---|---:|\n| 1 | `x` |\n| 2 | y z |"


def test_a_row_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"1 cells in \['c'\] for the 2 columns"):
        tables.write(("a", "b"), [("c",)])


def test_the_first_table_of_a_text_is_read_to_its_end():
    text = "# T\n\n| a | b |\n|---|:-:|\n| 1 | `x` |\n\nafter\n\n| no | more |\n"
    assert tables.read(text) == [("a", "b"), ("1", "`x`")]
    assert tables.read("none") == []
