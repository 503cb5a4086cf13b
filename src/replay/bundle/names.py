"""Which names a bundle may hold: those that mean one file, inside it, on every system.

The rules are checked before anything is read, when sealing as when verifying; a bundle that
breaks one is refused by the name.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

_MOST_BYTES = 1024
_MOST_PART_BYTES = 255
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
_FOREIGN = set('<>:"|?*')
_INVISIBLE = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


def shown(name: str) -> str:
    """Return `name` as it is safe to print: control and invisible characters escaped."""
    return "".join(
        c if unicodedata.category(c) not in _INVISIBLE else c.encode("unicode_escape").decode() for c in name
    )


def why_unsafe(name: str) -> str | None:
    """Say why a member's name is refused, or return None when it is plain.

    Parameters
    ----------
    name
        Path with forward slashes, relative to the bundle.
    """
    if not name:
        return "has no name"
    if name.startswith("/") or re.match(r"[A-Za-z]:", name):
        return "has an absolute path"
    if "\\" in name:
        return "has a backslash in its path"
    parts = name.split("/")
    if ".." in parts:
        return "leads out of the bundle"
    if name.endswith("/"):
        return "is a folder entry; a sealed bundle holds files alone"
    if "." in parts or "" in parts:
        return "has a path that is not in normal form"
    if any(unicodedata.category(c) in _INVISIBLE for c in name):
        return "has control or invisible characters in its name"
    if unicodedata.normalize("NFC", name) != name:
        return "has a name in another Unicode form than NFC"
    if len(name.encode("utf-8", "replace")) > _MOST_BYTES or any(len(p.encode()) > _MOST_PART_BYTES for p in parts):
        return "has a name that is too long"
    if any(_DEVICES.fullmatch(p) or p[-1] in ". " or _FOREIGN & set(p) for p in parts):
        return "has a name that some systems cannot store"
    return None


def find_collision(names: Iterable[str]) -> tuple[str, str, str] | None:
    """Find two names that would become one file, or a file where the other needs a folder.

    Returns
    -------
    tuple or None
        Both names and what is wrong with them.
    """
    seen: dict[str, str] = {}
    folders: dict[str, str] = {}
    for name in names:
        key = unicodedata.normalize("NFC", name).casefold()
        if key in seen:
            what = "occurs twice" if seen[key] == name else "differs in case alone from another entry"
            return name, seen[key], what
        seen[key] = name
        spelling = ""
        for part in name.split("/")[:-1]:
            spelling = f"{spelling}{part}/"
            folder = unicodedata.normalize("NFC", spelling).casefold()
            if folders.setdefault(folder, spelling) != spelling:
                return name, folders[folder], "lies in a folder that differs in case alone from another"
    for key, name in seen.items():
        if f"{key}/" in folders:
            return name, folders[f"{key}/"], "is a file where another entry needs a folder"
    return None
