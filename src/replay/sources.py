"""Which source files a stage stands on: its own, and those its imports lead to, name by name.

A workflow does not see imports; given these files as inputs it runs a stage again when one of them was edited, and
only then. A name that a package passes on counts for the file that defines it, not for the whole package.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

_IMPORT = re.compile(r"^[ \t]*(?:from (replay[\w.]*) import (\([^)]*\)|[^\n#]*)|import (replay[\w.]*))", re.MULTILINE)
_PACKAGE = Path(__file__).parent


def sources_of(file: Path, package: Path = _PACKAGE) -> list[Path]:
    """Every source file that `file` needs, itself first named, and the data beside them, sorted.

    Parameters
    ----------
    file
        A module of the package.
    package
        Folder of the package's sources: those of a checkout need not be those that run.
    """
    reached: set[Path] = set()
    _follow(file, package, reached)
    folders = {source.parent for source in reached}
    beside = [path for folder in folders for path in (*folder.iterdir(), *(folder / "data").rglob("*"))]
    data = {path for path in beside if path.is_file() and path.suffix not in (".py", ".pyc")}
    return sorted(reached | data)


def _follow(file: Path, package: Path, reached: set[Path]) -> None:
    if file in reached:
        return
    reached.add(file)
    for module, names in _imports(file):
        source = _file_of(package, module)
        if source is None:
            continue
        passed_on = names if source.name == "__init__.py" else ()
        for needed in [_definer(package, module, name) for name in passed_on] or [source]:
            _follow(needed, package, reached)


@cache
def _imports(file: Path) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Module and names of every import of the package; no names for the module itself."""
    text = file.read_text(encoding="utf-8")
    found = []
    for origin, names, whole in _IMPORT.findall(text):
        words = re.sub(r"#[^\n]*", "", names).strip("()\n\t ").split(",")
        found.append((origin or whole, tuple(word.split()[0] for word in words if word.strip()) if origin else ()))
    return tuple(found)


@cache
def _definer(package: Path, module: str, name: str) -> Path:
    """File that defines a name of a module: a module inside it, one it passes the name on from, or its own."""
    inner = _file_of(package, f"{module}.{name}")
    if inner is not None:
        return inner
    own = _file_of(package, module)
    assert own is not None
    for origin, names in _imports(own):
        source = _file_of(package, origin)
        if name in names and source is not None:
            return _definer(package, origin, name) if source.name == "__init__.py" else source
    return own


@cache
def _file_of(package: Path, module: str) -> Path | None:
    path = package.joinpath(*module.split(".")[1:])
    for candidate in (path.with_suffix(".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None
