from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations import text


@given(st.text(max_size=40))
def test_what_is_shown_holds_nothing_that_a_terminal_obeys(given_):
    shown = text.printable(given_)
    assert shown.isprintable()
    assert text.printable(shown) == shown
    assert text.printable(given_, lines=True).replace("\n", "").isprintable()


def test_text_without_control_characters_stays_as_it_is():
    assert text.printable("Höhe 5 m, 前视 ├─ <b>") == "Höhe 5 m, 前视 ├─ <b>"


def test_escapes_and_ends_of_lines_are_written_out():
    assert text.printable("a\x1b[2Jb\nc\u202ed") == "a\\x1b[2Jb\\nc\\u202ed"
    assert text.printable("a\n\x1bb", lines=True) == "a\n\\x1bb"


def test_a_tree_is_drawn_in_ascii_where_there_is_nothing_else():
    tree = "├─ dem.nc\n│  └─ Höhe"
    assert text.fitting(tree, "ascii") == "+- dem.nc\n|  +- H\\xf6he"
    assert text.fitting(tree, "latin-1") == "+- dem.nc\n|  +- Höhe"
    assert text.fitting(tree, "utf-8") == tree
    assert text.fitting("a", None) == "a"
