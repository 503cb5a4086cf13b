"""Files that went wrong in every way: a reader says one thing about each, and never hangs.

``python -m tests.motion.fuzz_readers 25000`` mutates that many files and prints the count of outcomes.
"""

from __future__ import annotations

import collections
import random
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tests.motion.formats import FORMATS, FPS, NAMES, SIZE, deeplabcut, pixels, sleap

from replay.errors import ReplayError
from replay.motion import synthesise
from replay.motion.readers import Context, read_tracks
from replay.motion.settings import load_camera
from replay.motion.tracks import Template, read_template
from replay.motion.wearable import read_wearable
from replay.play import WearableSource

TEMPLATE = Template(NAMES, np.array([[0.18, 0.0, -0.04], [0.13, 0.09, -0.05], [0.13, -0.09, -0.05], [0.14, 0.0, 0.08]]))
LONGEST_S = 10
TOKENS = [
    *("", "nan", "NaN", "inf", "-inf", "1e999", "-1e308", "1e18", "99999999999999999999", "-1", "0", "0.1e-400", "1,5"),
    *("1.234.567,8", ",", ";", "\t", "\n", "\n\n\n", '"', '""', "'", "<", ">", "&", "&amp;", "&#0;", "]]>", "<!--"),
    *("</Track>", "<Track>", '<!DOCTYPE a [<!ENTITY b "c">]>', "x;y;t", "1;2", ";;;;", "0:00:00:00", "99:99:99:99"),
    *("Time", "frame", "scorer", "coords", "track", "LM1", "LM2", "é", "\u0661", "\ufeff", "\x00", "\x1a", "𝟙", "²"),
    *("frame_idx", "individuals", "true", "None", "0x10", "1_000", "+5", "5.", ".5", "1e5", "--1", "# LM1", "#"),
]


def _wearable(path: Path) -> object:
    source = WearableSource.model_validate(
        {
            "columns": {
                "time": {"name": "time_ms", "unit": "ms"},
                "acceleration": {"names": ["ax_g", "ay_g", "az_g"], "unit": "g"},
                "angular_velocity": {
                    "names": ["wx_deg_per_s", "wy_deg_per_s", "wz_deg_per_s"],
                    "unit": "deg/s",
                },
            },
            "axes": "sae_j211",
            "sensor_to_cg_m": [0, 0, 0],
            "filter": {"kind": "none"},
        }
    )
    return read_wearable(path, source)


def subjects() -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Good files by name, each with its reader."""
    context = Context(FPS, SIZE)

    def tracks(path: Path) -> object:
        return read_tracks(path, TEMPLATE, context)

    demo, worn = synthesise("demo").files, synthesise("wearable").files
    several = {"deeplabcut, two": deeplabcut(pixels(), ("a", "b")), "sleap, two": sleap(pixels(), ("a", "b"))}
    out: dict[str, tuple[str, Callable[[Path], object]]] = {
        n: (write(pixels()), tracks) for n, write in FORMATS.items()
    }
    out |= {name: (text, tracks) for name, text in several.items()}
    out["template"] = (demo["helmet_landmarks.csv"], read_template)
    out["camera"] = (demo["Config.json"], load_camera)
    out["wearable"] = (worn["wearable.csv"], _wearable)
    return out


def mutated(text: str, others: list[str], rng: random.Random) -> bytes:
    """Spoil a file once, or up to six times."""
    data = text
    for _ in range(rng.choice([1, 1, 1, 2, 3, 6])):
        lines = data.split("\n")
        at = rng.randrange(len(data)) if data else 0
        line = rng.randrange(len(lines))
        kind = rng.randrange(12)
        if kind == 0:
            data = data[:at] + rng.choice(TOKENS) + data[at:]
        elif kind == 1:
            data = data[:at] + data[at + rng.randint(1, 40) :]
        elif kind == 2:
            data = data[:at]
        elif kind == 3:
            lines.insert(rng.randrange(len(lines) + 1), lines[line])
            data = "\n".join(lines)
        elif kind == 4:
            del lines[line]
            data = "\n".join(lines)
        elif kind == 5:
            rng.shuffle(lines)
            data = "\n".join(lines)
        elif kind == 6:
            data = data.replace(rng.choice([",", ";", ".", "\n", " ", '"', ">", "0", "1"]), rng.choice(TOKENS))
        elif kind == 7:
            for mark in (",", ";", " ", ">"):
                cells = lines[line].split(mark)
                if len(cells) > 1:
                    cells[rng.randrange(len(cells))] = rng.choice(TOKENS)
                    lines[line] = mark.join(cells)
                    break
            data = "\n".join(lines)
        elif kind == 8:
            other = rng.choice(others)
            data = data[:at] + other[rng.randrange(len(other)) :]
        elif kind == 9:
            piece = data[at : at + rng.randint(1, 60)]
            data = data[:at] + piece * rng.choice([2, 50, 2000]) + data[at:]
        elif kind == 10 and data:
            data = data[:at] + chr(rng.randrange(1, 0x250)) + data[at + 1 :]
        data = data[:400_000]
    raw = data.encode("utf-8", "surrogatepass")
    if rng.random() < 0.1 and raw:
        at = rng.randrange(len(raw))
        raw = raw[:at] + bytes([rng.randrange(256)]) + raw[at + 1 :]
    return raw


def _hangs(*_: object) -> None:
    message = f"no answer within {LONGEST_S} s"
    raise TimeoutError(message)


def fuzz(count: int, seed: int) -> tuple[collections.Counter[str], list[str], float]:
    """Mutate `count` files; outcomes, failures with how to repeat them, and the longest reading [s]."""
    rng = random.Random(seed)
    known = subjects()
    names, texts = list(known), [text for text, _ in known.values()]
    outcomes: collections.Counter[str] = collections.Counter()
    failures: list[str] = []
    slowest = 0.0
    signal.signal(signal.SIGALRM, _hangs)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spoilt"
        for number in range(count):
            name = names[number % len(names)]
            text, read = known[name]
            raw = mutated(text, texts, rng)
            path.write_bytes(raw)
            begin = time.process_time()
            signal.alarm(LONGEST_S)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    read(path)
                outcomes["read"] += 1
            except ReplayError as error:
                good = error.exit_code == 2 and str(path) in str(error) and len(str(error)) < 20_000
                outcomes["refused" if good else "refused badly"] += 1
                if not good:
                    failures.append(f"{name} {number}: {str(error)[:500]!r}")
            except Exception as error:
                outcomes[type(error).__name__] += 1
                failures.append(f"{name} {number}: {''.join(traceback.format_exception(error)[-4:])}")
            finally:
                signal.alarm(0)
            slowest = max(slowest, time.process_time() - begin)
    return outcomes, failures, slowest


if __name__ == "__main__":
    found, wrong, longest = fuzz(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(dict(found), f"slowest {longest:.2f} s")
    print("\n".join(dict.fromkeys(wrong[:20])))
    sys.exit(1 if wrong else 0)
