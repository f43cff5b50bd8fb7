import json
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from vinsar.foundations import strict_yaml

ROOT = Path(__file__).parents[2]


@pytest.fixture
def load(tmp_path):
    def read(content):
        path = tmp_path / "study.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return strict_yaml.load(path)

    return read


def refused(load, content, *words, line=None, column=None):
    with pytest.raises(strict_yaml.FileError) as caught:
        load(content)
    said = str(caught.value)
    assert "\n" not in said
    assert "study.yaml" in said
    for word in words:
        assert word in said
    if line is not None:
        assert f"line {line}, column {column}: " in said


def test_every_study_of_ours_is_read_as_pyyaml_reads_it():
    studies = sorted([*(ROOT / "config").glob("*.yaml"), *(ROOT / "tests").rglob("*.yaml")])
    assert len(studies) > 5
    for path in studies:
        assert strict_yaml.load(path) == yaml.safe_load(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("content", "line", "column"),
    [
        ("radar: {rail_height_m: 2.0}\nseed: 1\nradar: {baseline_m: 0.3}\n", 3, 1),
        ("sweeps:\n  a:\n    realizations: 1\n    realizations: 2\n", 4, 5),
        ("a: {b: 1, c: 2, b: 1}\n", 1, 17),
        ("a: 1\n'a': 2\n", 2, 1),
    ],
)
def test_a_key_that_stands_there_twice_is_refused(load, content, line, column):
    refused(load, content, "is given twice, first in line", line=line, column=column)


def test_a_key_that_stands_there_twice_in_json_is_refused(load):
    refused(load, '{"seed": 1, "radar": {}, "seed": 2}', "the key 'seed' is given twice")


@pytest.mark.parametrize(
    ("text", "instead"),
    [
        ("0401", "write 401,"), ("-017", "write -17,"), ("09", "write 9,"), ("1:30", "in quotes"),
        ("190:20:30.5", "in quotes"), ("1_000", "write 1000,"), ("1e9", "write 1.0e+9,"),
        ("13.0e9", "write 13.0e+9,"), ("-2E-3", "write -2.0e-3,"), ("0b101", "in quotes"),
        ("0o17", "in quotes"), ("-.5", "write -0.5,"), ("yes", "write true,"),
        ("Off", "write false,"), ("2014-01-01", "in quotes"), ("=", "in quotes"),
        ("1_0.5", "write 10.5,"), ("-0x1F", "in quotes"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("form", ["a: {}\n", "- x\n- {}\n", "a: [1, {}]\n", "{}: 1\n"])
def test_what_readers_of_yaml_take_differently_is_refused(load, text, instead, form):
    content = "first: 1\n" + ("" if form[0] != "-" else "list:\n") + form.replace("{}", text)
    refused(load, content, f"'{text}' is " if form[0] != "{" else "", line=content.count("\n"),
            column=content.splitlines()[-1].index(text) + 1)  # fmt: skip
    if form == "a: {}\n":
        refused(load, content, f"'{text}' is ", instead)


@given(st.text(alphabet="0123456789_.:+-eExobyYnofNaAi", min_size=1, max_size=8))
def test_what_is_read_is_what_yaml_1_2_says(text):
    """A plain scalar is refused, or a number, boolean or text by YAML 1.2's core schema."""
    path = Path("/dev/null")
    try:
        value = strict_yaml._yaml(path, f"a: {text}\n")["a"]
    except strict_yaml.FileError:
        return
    if re.fullmatch(r"[-+]?[0-9]+", text):
        assert type(value) is int
        assert value == int(text, 10)
    elif re.fullmatch(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", text):
        assert type(value) is float
        assert value == float(text)
    elif re.fullmatch(r"0x[0-9a-fA-F]+", text):
        assert value == int(text, 16)
    else:
        assert isinstance(value, str) or text.lower() in (".nan",)


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
        max_leaves=12,
    )
)
def test_what_json_can_write_is_read_back(value):
    path = Path("/dev/null")
    assert strict_yaml._json(path, json.dumps({"a": value})) == {"a": value}


@pytest.mark.parametrize(
    ("content", "words", "line", "column"),
    [
        ("name: Gelände\n".encode("latin-1"), "byte 0xe4 is not UTF-8; save it as UTF-8", 1, 10),
        ("# a\nstudy: a\n".encode("utf-16"), "it is UTF-16; save it as UTF-8", 1, 1),
        (b"a: 1\nb: \x00\n", "the character U+0000 is not allowed", 2, 4),
        (b"a: 1\nb: [1, 2\nc: 3\n", "expected ',' or ']'", 3, 2),
        (b"radar:\n\tbaseline_m: 0.3\n", "indent with spaces", 2, 1),
        (b"a: b: c\n", "mapping values are not allowed here", 1, 5),
        (b"a: 'open\n", "while scanning", 2, 1),
        (b"a: 1\n---\nb: 2\n", "several documents", 2, 1),
        (b"a: *unknown\n", "undefined alias 'unknown'", 1, 4),
        (b"a: !!python/tuple [1, 2]\n", "the tag !!python/tuple is not allowed", 1, 4),
        (b"a: !!python/object/apply:os.getcwd []\n", "is not allowed", 1, 4),
        (b"a: !!str 5\n", "the tag !!str is not allowed", 1, 4),
        (b"a: !own {b: 1}\n", "the tag !own is not allowed", 1, 4),
        (b"a: &a [*a]\n", "an alias (*) stands within what it repeats", 1, 4),
        (b"a: &a {b: 1}\nc: {<<: *a}\n", "'<<' is ", 2, 5),
        (b"1: 2\n", "the key 1 is a whole number; a key is text", 1, 1),
        (b"null: 2\n", "the key null is nothing; a key is text", 1, 1),
        (b"? [a, b]\n: 2\n", "a key is itself a list", 1, 3),
    ],
)
def test_what_cannot_be_read_is_a_sentence_with_its_place(load, content, words, line, column):
    refused(load, content, "" if words == "while scanning" else words)
    with pytest.raises(strict_yaml.FileError, match=f"line {line}, column {column}: "):
        load(content)


@pytest.mark.parametrize("content", [b"[1, 2]", b"- a\n", b"text", b"5\n", b'"text"'])
def test_a_file_without_keys_is_refused(load, content):
    refused(load, content, "keys with values are needed")


@pytest.mark.parametrize("content", [b"", b"# only a comment\n", b"---\n", b"{}"])
def test_an_empty_file_has_no_keys(load, content):
    assert load(content) == {}


@pytest.mark.parametrize("value", ["true", "false", "null", "1"])
def test_a_file_that_asks_to_be_run_is_refused(load, value):
    code = "__definitions__:\n  - import os\na: ?os.getcwd()\n"
    refused(load, f"__use_yte__: {value}\n{code}", "would run it as a program")
    refused(load, f'{{"__use_yte__": {value}}}', "would run it as a program")


def test_aliases_that_stand_for_more_than_memory_are_refused_soon(load):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 20)]
    refused(load, "\n".join(lines), "its aliases stand for more than")


@pytest.mark.parametrize("depth", [60, 5_000, 200_000])
@pytest.mark.parametrize("quote", ["", '"'])
def test_what_is_nested_too_deeply_is_refused(load, depth, quote):
    refused(load, f"{{{quote}a{quote}: " + "[" * depth + "]" * depth + "}", "is nested deeper")


def test_a_whole_number_of_thousands_of_digits_is_refused(load):
    refused(load, "a: " + "9" * 5000, "digits")
    refused(load, '{"a": ' + "9" * 5000 + "}", "digits")


def test_what_is_no_file_is_a_sentence(tmp_path):
    for path, words in ((tmp_path / "none.yaml", "no such file"), (tmp_path, "it is no file")):
        with pytest.raises(strict_yaml.FileError, match=words):
            strict_yaml.load(path)


def test_a_mark_of_byte_order_is_passed_over(load):
    assert load(b"\xef\xbb\xbfstudy: a\n") == {"study": "a"}
