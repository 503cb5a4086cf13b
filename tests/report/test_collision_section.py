"""The page of a collision: the scene, the force, and published numbers beside the run's, each with a reason."""

from __future__ import annotations

import dataclasses
import struct
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from finished_play import finished_play

from replay.report import write_report
from replay.report.published import published_section

KEYS = [row["key"] for row in yaml.safe_load(Path("src/replay/report/published.yaml").read_text(encoding="utf-8"))]


def one_pixel() -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    pixels = zlib.compress(b"\x00\x80\x80\x80")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def test_every_published_number_stands_beside_one_of_the_run_with_a_reason() -> None:
    html = published_section(dict.fromkeys(KEYS, 1.25))
    assert html.count("1.25") == len(KEYS)
    assert "cannot be in joule seconds" in html
    with pytest.raises(KeyError):
        published_section(dict.fromkeys(KEYS[1:], 1.0))


def test_a_collision_has_a_section_that_a_driven_head_has_not(tmp_path: Path) -> None:
    driven = finished_play()
    time = np.linspace(1e-4, 0.03, 300)
    force = 4e3 * np.exp(-(((time - 0.003) / 0.002) ** 2))
    blow = pd.DataFrame({"time_s": time, "force_x_N": -force, "force_y_N": 0.0, "force_z_N": 0.0, "force_N": force})
    pads = [{"part": "energy_pad_front_2", "compression_mean": 0.31, "compression_max": 0.5, "time_s": 0.0041}]
    collided = dataclasses.replace(driven, published=dict.fromkeys(KEYS, 2.0), blow=blow, pads=pads, scene=one_pixel())
    pages = [
        write_report(tmp_path / name, play).read_text(encoding="utf-8")
        for name, play in (("a", driven), ("b", collided))
    ]
    assert ['id="collision"' in page for page in pages] == [False, True]
    assert "The head in the model is free" in pages[1]
    assert "energy pad front 2" in pages[1]
    assert (tmp_path / "b/figures/first_contact.png").is_file()
