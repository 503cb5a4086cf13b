"""Nothing is ever half-written, and a full disk is a message."""

from __future__ import annotations

import errno
import json
import math
from pathlib import Path

import numpy as np
import pytest

from replay.errors import InputError, ReplayError
from replay.files import atomic_path, read_json, sha256, write_json, write_text


def test_a_failing_writer_leaves_the_old_file_and_no_debris(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError, match="half way"), atomic_path(path) as temporary:
        temporary.write_text("new, but only ha")
        message = "half way"
        raise RuntimeError(message)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_full_disk_is_one_message_and_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(ReplayError, match="No space left(.|\n)*free disk space"), atomic_path(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_json_has_no_nan_and_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_json(path, {"b": np.float64(0.1), "a": [math.nan, np.int64(3)], "c": np.arange(2), "d": Path("x/y")})
    assert json.loads(path.read_text()) == {"b": 0.1, "a": [None, 3], "c": [0, 1], "d": "x/y"}
    assert list(read_json(path)) == ["b", "a", "c", "d"]


def test_broken_json_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"fps": 59.94,\n "x": }\n')
    with pytest.raises(InputError, match=r"a.json:2: is not JSON"):
        read_json(tmp_path / "a.json")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_json(tmp_path / "nothing.json")


def test_sha256_of_the_empty_file(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    assert sha256(tmp_path / "empty") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
