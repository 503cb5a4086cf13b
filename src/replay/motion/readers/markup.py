"""XML with the line of every element, no entities, no document types."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from replay.errors import InputError
from replay.files import read_text


@dataclass
class Node:
    """One element: name and attributes without their prefixes, text, children, and its line."""

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list[Node] = field(default_factory=list)

    def find(self, tag: str) -> Node | None:
        """First child of that name."""
        return next((child for child in self.children if child.tag == tag), None)

    def all(self, tag: str) -> Iterator[Node]:
        """Every descendant of that name, in document order."""
        stack = list(reversed(self.children))
        while stack:
            node = stack.pop()
            if node.tag == tag:
                yield node
            stack.extend(reversed(node.children))

    def value(self, tag: str) -> str:
        """Text of the first child of that name, or nothing."""
        child = self.find(tag)
        return child.text.strip() if child else ""


def parse(path: Path) -> Node:
    """Read an XML file.

    Raises
    ------
    InputError
        What is not well-formed, by line; a document type, which no export has and entities could hide in.
    """
    text = read_text(path)
    root = Node("", {}, 1)
    stack = [root]
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        plain = {name.rpartition(":")[2]: value for name, value in attributes.items()}
        node = Node(tag.rpartition(":")[2], plain, parser.CurrentLineNumber)
        stack[-1].children.append(node)
        stack.append(node)

    def end(_: str) -> None:
        stack.pop()

    def characters(data: str) -> None:
        stack[-1].text += data

    def doctype(*_: object) -> None:
        raise InputError(
            path,
            "has a document type",
            line=parser.CurrentLineNumber,
            expected="an export of Kinovea, which has none",
            mend="export the file again",
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = characters, doctype
    try:
        # already decoded: the encoding that the file declares no longer matters
        parser.Parse(_without_declaration(text).encode("utf-8"), True)
    except expat.ExpatError as error:
        found = f"is not well-formed XML: {expat.errors.messages[error.code]}"
        raise InputError(path, found, line=error.lineno, mend="export the file again") from None
    return root.children[0]


def _without_declaration(text: str) -> str:
    stripped = text.lstrip()
    if stripped.startswith("<?xml") and "?>" in stripped:
        declaration, _, rest = stripped.partition("?>")
        return "\n" * declaration.count("\n") + rest
    return stripped
