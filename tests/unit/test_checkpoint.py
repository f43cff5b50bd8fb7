import errno
import json
import math
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vinsar.sweeps import checkpoint


@pytest.fixture
def kept(tmp_path):
    return checkpoint.Checkpoint(tmp_path / "sweeps" / ".vibration.jsonl", "code")


def test_what_was_kept_is_read_again_to_the_last_bit(kept):
    rows = {"a": {"std": [0.1, 1 / 3, math.pi * 1e-17], "residues": 7}, "b": {"std": [1e300]}}
    assert kept.rows() == {}
    kept.keep({"a": rows["a"]})
    kept.keep({})
    kept.keep({"b": rows["b"]})
    assert kept.rows() == rows
    kept.keep({"c": {"std": [math.nan]}})
    assert math.isnan(kept.rows()["c"]["std"][0])
    kept.remove()
    kept.remove()
    assert kept.rows() == {}


def test_a_block_that_was_cut_short_is_not_read_and_harms_no_other(kept):
    kept.keep({"a": {"std": [1.0]}})
    kept.keep({"b": {"std": [2.0]}})
    whole = kept.path.read_bytes()
    for length in range(len(whole) - 30, len(whole) - 1):
        kept.path.write_bytes(whole[:length])
        assert kept.rows() == {"a": {"std": [1.0]}}
        kept.keep({"c": {"std": [3.0]}})
        assert kept.rows() == {"a": {"std": [1.0]}, "c": {"std": [3.0]}}


ODD = b'{"code": "code", "rows": 5}'


@pytest.mark.parametrize(
    "rubbish",
    [b"\0" * 512, b"\xff\xfe{}", b"7", b"[]", b'{"rows": {}}', ODD, b"0" * 64 + b" " + ODD],
)
def test_rubbish_between_blocks_is_passed_over(kept, rubbish):
    kept.keep({"a": {"std": [1.0]}})
    with kept.path.open("ab") as file:
        file.write(rubbish)
    kept.keep({"b": {"std": [2.0]}})
    assert set(kept.rows()) == {"a", "b"}


def test_rows_of_other_code_are_not_read(kept):
    checkpoint.Checkpoint(kept.path, "other").keep({"a": {"std": [1.0]}})
    kept.keep({"b": {"std": [2.0]}})
    assert set(kept.rows()) == {"b"}


def test_a_block_is_one_write_at_the_end_and_is_on_disk_afterwards(kept, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_size))
    other = checkpoint.Checkpoint(kept.path, "code")
    kept.keep({"a": {"std": [1.0] * 5000}})
    other.keep({"b": {"std": [2.0] * 5000}})
    assert set(kept.rows()) == {"a", "b"}
    assert synced == [len(kept.path.read_bytes()) // 2, len(kept.path.read_bytes())]
    lines = [line.partition(" ")[2] for line in kept.path.read_text().split("\n") if line]
    assert [list(json.loads(line)["rows"]) for line in lines] == [["a"], ["b"]]


def test_a_full_disk_is_said_with_the_name_of_the_file(tmp_path):
    (tmp_path / ".vibration.jsonl").symlink_to("/dev/full")
    full = checkpoint.Checkpoint(tmp_path / ".vibration.jsonl", "code")
    with pytest.raises(OSError, match=f"vibration.jsonl: {os.strerror(errno.ENOSPC)}"):
        full.keep({"a": {"std": [1.0]}})


@given(st.data())
def test_a_flipped_bit_costs_its_line_alone_and_is_named(data):
    with TemporaryDirectory() as folder:
        kept = checkpoint.Checkpoint(Path(folder) / ".noise.jsonl", "code")
        kept.keep({"a": {"std": [1.25, 3.5], "residues": 7}})
        first = kept.path.stat().st_size
        kept.keep({"b": {"std": [2.0]}})
        content = bytearray(kept.path.read_bytes())
        place = data.draw(st.integers(0, first - 1))
        content[place] ^= 1 << data.draw(st.integers(0, 7))
        kept.path.write_bytes(content)
        found = kept.rows()
        assert found["b"] == {"std": [2.0]}
        # A flip of what is between the lines harms none.
        assert found.get("a") in (None, {"std": [1.25, 3.5], "residues": 7})


def test_a_line_that_was_changed_is_named(kept, caplog):
    kept.keep({"a": {"std": [1.25]}})
    kept.path.write_text(kept.path.read_text().replace("1.25", "1.35"))
    assert kept.rows() == {}
    (said,) = caplog.messages
    assert said == f"line 2 of {kept.path} is not as it was written; its cases are computed again"
