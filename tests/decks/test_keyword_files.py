"""The many ways in which people write keyword files, and what a user is told where one cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.decks.keyword import KeywordDeck, read_keyword
from replay.decks.keyword.parameters import evaluate
from replay.errors import InputError, InputErrors

CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
NODES = "*NODE\n" + "".join(f"{k:8d}{x:16.1f}{y:16.1f}{z:16.1f}\n" for k, (x, y, z) in enumerate(CUBE, 1))
ONE_LINE = "*ELEMENT_SOLID\n" + "".join(f"{n:8d}" for n in (5, 3, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"


def read(folder: Path, text: str, **others: str) -> KeywordDeck:
    for name, content in others.items():
        (folder / f"{name}.k").write_text(content, encoding="utf-8")
    path = folder / "deck.k"
    path.write_bytes(text.encode("utf-8"))
    return read_keyword(path)


def is_the_cube(deck: KeywordDeck) -> bool:
    return (
        deck.node_ids.tolist() == list(range(1, 9))
        and bool((deck.nodes == np.array(CUBE)).all())
        and deck.solids.ids.tolist() == [5]
        and deck.solids.parts.tolist() == [3]
        and deck.solids.nodes[0, :8].tolist() == list(range(1, 9))
    )


def long_node() -> str:
    return "".join(f"{k:20d}{x:20.1f}{y:20.1f}{z:20.1f}\n" for k, (x, y, z) in enumerate(CUBE, 1))


def named(coordinate: float) -> str:
    return "&one" if coordinate else "0"


WIDE = "".join(f"{n:20d}" for n in (5, 3, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"
EIGHT = ONE_LINE.split("\n")[1][16:]
TEN = "".join(f"{n:10d}" for n in (5, 3, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"
TEN_NODES = "".join(f"{k:10d}{x:16.1f}{y:16.1f}{z:16.1f}\n" for k, (x, y, z) in enumerate(CUBE, 1))
SAME_CUBE = {
    "one line an element": "*KEYWORD\n" + NODES + ONE_LINE + "*END\n",
    "two lines an element": "*KEYWORD\n" + NODES + "*ELEMENT_SOLID\n       5       3\n" + EIGHT + "\n",
    "ten-node layout": "*KEYWORD\n" + NODES + "*ELEMENT_SOLID (ten nodes format)\n       5       3\n"
    + EIGHT + "       0       0\n*END\n",
    "commas": "*KEYWORD\n*NODE\n" + "".join(f"{k}, {x}.,{y} , {z}e0\n" for k, (x, y, z) in enumerate(CUBE, 1))
    + "*ELEMENT_SOLID\n5,3,1,2,3,4,5,6,7,8\n",
    "commas on two lines": "*KEYWORD\n" + NODES + "*ELEMENT_SOLID\n5,3\n1,2,3,4,5,6,7,8\n",
    "one line with commas among columns": "*KEYWORD\n" + NODES.replace(NODES.split("\n")[2], "2,1,0,0") + ONE_LINE,
    "exponents without letter": "*KEYWORD\n" + NODES.replace("             1.0", "          10.0-1") + ONE_LINE,
    "exponents with D": "*KEYWORD\n" + NODES.replace("             1.0", "          0.1D+1") + ONE_LINE,
    "comments everywhere": "$ head\n*KEYWORD\n$\n" + NODES.replace("\n", "\n$ between\n")
    + ONE_LINE.replace("\n", "\n$#\n"),
    "wrong case": "*keyword\n" + NODES.lower() + ONE_LINE.replace("ELEMENT_SOLID", "Element_Solid") + "*End\n",
    "CRLF": ("*KEYWORD\n" + NODES + ONE_LINE + "*END\n").replace("\n", "\r\n"),
    "byte-order mark": "\ufeff*KEYWORD\n" + NODES + ONE_LINE,
    "constraint codes": "*KEYWORD\n" + NODES.replace(".0\n", ".0       0       0\n") + ONE_LINE,
    "blank lines at the end": "*KEYWORD\n" + NODES + "\n\n" + ONE_LINE + "\n   \n*END\n",
    "long layout of the file": "*KEYWORD LONG=Y\n*NODE\n" + long_node() + "*ELEMENT_SOLID\n" + WIDE,
    "long layout of a keyword": "*KEYWORD\n*NODE +\n" + long_node() + "*ELEMENT_SOLID+\n" + WIDE,
    "standard keyword in a long file": "*KEYWORD LONG=Y\n" + NODES.replace("*NODE", "*NODE -")
    + "*ELEMENT_SOLID\n" + WIDE,
    "ten-column numbers": "*KEYWORD I10=Y\n*NODE\n" + TEN_NODES + "*ELEMENT_SOLID\n" + TEN,
    "ten-column numbers of a keyword": "*KEYWORD\n" + NODES + "*ELEMENT_SOLID %\n" + TEN,
    "parameters": "*KEYWORD\n*PARAMETER\nR       one,1.0,I pid,3\nI     last         8\n*NODE\n"
    + "".join(f"{k},{named(x)},{named(y).upper()},{named(z)}\n" for k, (x, y, z) in enumerate(CUBE, 1))
    + "*ELEMENT_SOLID\n5,&pid,1,2,3,4,5,6,7,&last\n",
    "expressions": "*KEYWORD\n*PARAMETER\nR     half       0.5\n*PARAMETER_EXPRESSION\nR      one 2*&half**1 + sin(0)\n"
    "I      pid 7/2\n*NODE\n"
    + "".join(f"{k},{named(x)},{y},{named(z)}\n" for k, (x, y, z) in enumerate(CUBE, 1))
    + "*ELEMENT_SOLID\n5,&pid,1,2,3,4,5,6,7,8\n",
}  # fmt: skip


@pytest.mark.parametrize("way", list(SAME_CUBE))
def test_one_cube_in_many_ways(tmp_path: Path, way: str) -> None:
    assert is_the_cube(read(tmp_path, SAME_CUBE[way]))


def test_columns_that_touch_are_told_apart(tmp_path: Path) -> None:
    nodes = "*NODE\n" + "".join(
        f"{10000000 + k:8d}{x - 5000.123456789:16.9f}{y:16.9f}{z:16.9f}\n" for k, (x, y, z) in enumerate(CUBE, 1)
    )
    element = "*ELEMENT_SOLID\n" + "".join(f"{n:8d}" for n in (10000001, 10000001, *range(10000001, 10000009))) + "\n"
    deck = read(tmp_path, "*KEYWORD\n" + nodes + element)
    assert deck.solids.nodes[0, :8].tolist() == list(range(10000001, 10000009))
    assert deck.nodes[0, 0] == -5000.123456789


def test_a_blank_title_is_a_title_and_parts_may_share_a_keyword(tmp_path: Path) -> None:
    deck = read(
        tmp_path, "*KEYWORD\n*PART\n\n         3         1         2\nfoam, inner\n         4         1         2\n"
    )
    parts = deck.of_kind("part")
    assert {pid: (e.title, e.whole("mid")) for pid, e in parts.items()} == {3: ("", 2), 4: ("foam, inner", 2)}


def test_titles_ids_and_mpp_cards_are_heads_not_data(tmp_path: Path) -> None:
    deck = read(
        tmp_path,
        "*KEYWORD\n*SET_NODE_LIST_TITLE\nmount left\n        12\n         1         2\n"
        "*MAT_ELASTIC_TITLE\nsteel\n         7    7850.0   2.1e+11       0.3\n"
        "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_MPP_ID\n        44pads on shell\n         0       200\n"
        "         1         2         3         3\n       0.5       0.4\n       1.0       1.0\n         2       0.1\n",
    )
    assert deck.of_kind("node_set")[12].title == "mount left"
    assert deck.of_kind("material")[7].title == "steel"
    contact = deck.of_kind("contact")[44]
    assert (contact.title, contact.number("fs"), len(contact.extra), len(contact.mpp)) == ("pads on shell", 0.5, 1, 1)
    assert list(contact.references())[:2] == [("part", "ssid", 1, 12), ("part", "msid", 2, 12)]


def test_numbers_of_laws_are_their_names(tmp_path: Path) -> None:
    deck = read(
        tmp_path,
        "*KEYWORD\n*MAT_024\n         1    7850.0    2.1e11       0.3     3.0e8\n*mat_077_o\n         2    1000.0\n",
    )
    assert [e.keyword for e in deck.entries] == ["MAT_PIECEWISE_LINEAR_PLASTICITY", "MAT_OGDEN_RUBBER"]


def test_unknown_keywords_are_kept_as_they_stand_and_explained(tmp_path: Path) -> None:
    text = (
        "*KEYWORD\n"
        + NODES
        + "*LOAD_GRAVITY_PART\n$ a comment\n   7  anything, &goes\n\n*Some_New_Thing\n  1\n"
        + ONE_LINE
    )
    deck = read(tmp_path, text)
    assert is_the_cube(deck)
    assert [k.text for k in deck.kept] == [
        "*LOAD_GRAVITY_PART\n$ a comment\n   7  anything, &goes\n",
        "*Some_New_Thing\n  1\n",
    ]
    assert [(r.keyword, r.line, r.meaning) for r in deck.remarks] == [
        ("*LOAD_GRAVITY_PART", 11, "this load is not applied"),
        ("*SOME_NEW_THING", 15, "not understood: nothing of it takes part in a run"),
    ]


def test_text_outside_keywords_and_beyond_columns_is_reported(tmp_path: Path) -> None:
    junk = ONE_LINE.rstrip("\n") + "  made by hand\n"
    deck = read(tmp_path, "exported on Monday\n*KEYWORD\n" + NODES + junk + "*END\nappendix\n")
    assert is_the_cube(deck)
    assert [(r.line, r.meaning) for r in deck.remarks] == [
        (1, "text outside the keywords; no effect"),
        (13, "text beyond column 80 in 1 lines is not read"),
        (14, "text outside the keywords; no effect"),
    ]


def test_includes_and_their_search_path(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a_long_name.k").write_text(NODES)
    deck = read(
        tmp_path,
        "*KEYWORD\n*INCLUDE_PATH\nparts\n*INCLUDE\na_long +\n_name.k\n*INCLUDE\n..\\" + tmp_path.name + "\\mesh.k\n",
        mesh=ONE_LINE,
    )
    assert is_the_cube(deck)
    assert [f.name for f in deck.files] == ["deck.k", "a_long_name.k", "mesh.k"]


def test_an_include_is_shifted_scaled_and_moved(tmp_path: Path) -> None:
    inner = (
        NODES + ONE_LINE + "*PART\nblock\n         3         8         9\n*SECTION_SOLID\n         8         1\n"
        "*MAT_ELASTIC\n         9   7.85e-9  210000.0       0.3\n*SET_PART_LIST\n         2\n         3\n"
    )
    deck = read(
        tmp_path,
        "*KEYWORD\n*DEFINE_TRANSFORMATION\n        30\n"
        "    ROTATE       0.0       0.0       1.0       0.0       0.0       0.0      90.0\n"
        "    TRANSL       5.0       0.0       0.0\n"
        "*INCLUDE_TRANSFORM\nblock.k\n      1000      2000      3000      4000      5000      6000      7000\n"
        "      8000\n    1000.0       1.0     0.001       1.0         1\n        30\n",
        block=inner,
    )
    assert deck.node_ids.tolist() == list(range(1001, 1009))
    np.testing.assert_allclose(deck.nodes[1], [5.0, 0.001, 0.0], atol=1e-15)  # (1, 0, 0) mm -> m, turned, moved
    assert deck.solids.ids.tolist() == [2005]
    assert deck.solids.nodes[0, :8].tolist() == list(range(1001, 1009))
    part, material = deck.of_kind("part")[3003], deck.of_kind("material")[4009]
    assert (part.whole("secid"), part.whole("mid")) == (8008, 4009)
    assert (material.number("ro"), material.number("e")) == (pytest.approx(7850.0), pytest.approx(2.1e11))
    assert deck.of_kind("part_set")[5002].members() == (3003,)


@pytest.mark.parametrize(
    ("text", "value"),
    [("1+2*3", 7), ("7/2", 3), ("-7/2", -3), ("7.0/2", 3.5), ("2**3", 8), ("sqrt(16)*pi/pi", 4), ("min(3,2)", 2),
     ("&a-1", 4)],
)  # fmt: skip
def test_expressions_follow_fortran(text: str, value: float) -> None:
    assert evaluate(text, {"a": 5}) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "line", "column", "match"),
    [
        ("", 1, "keyword", "has no keyword"),
        ("just text\n", 1, "keyword", "has no keyword"),
        ("*KEYWORD\n*\n", 2, "keyword", "asterisk without a keyword"),
        (NODES.replace("       3", "       x"), 4, "nid", "'x' is no number of a node"),
        (NODES.replace("       3", "      -3"), 4, "nid", "'-3' is no number"),
        (NODES.replace("             1.0", "            1..0", 1), 3, "x", "'1..0' is no number"),
        (NODES.replace("             1.0", "           1e999", 1), 3, "x", "'1e999' is no number"),
        (NODES.replace("             1.0", "             nan", 1), 3, "x", "'nan' is no number"),
        (NODES.replace("             1.0", "            &big", 1), 3, "x", "the parameter 'big' is not defined"),
        (NODES + ONE_LINE.replace("       8", "      88"), 11, "n8", "element 5 names node 88, which is not there"),
        (NODES + ONE_LINE[:60] + "\n", 11, "n4", "element 5 has no node there"),
        (NODES + ONE_LINE[:80] + "\n", 11, "n7", "element 5 has no node there"),
        (NODES + "*ELEMENT_SOLID\n       5       3\n", 11, "n1", "the line of its nodes is missing"),
        ("*PART\nfoam\n", 1, "pid", "*PART ends after 1 cards"),
        ("*PART\n", 1, "title", "*PART has no card"),
        ("*PART\nfoam\n       1.5\n", 3, "pid", "'1.5' is no number of a part"),
        ("*MAT_ELASTIC\n         1      dens\n", 2, "ro", "'dens' is no number"),
        ("*MAT_ELASTIC\n                 1.0\n", 1, "mid", "it is blank"),
        ("*INCLUDE\nnowhere.k\n", 2, "filename", "the file nowhere.k is not there"),
        ("*INCLUDE\n", 1, "filename", "no file is named"),
        ("*INCLUDE\ndeck.k\n", 2, "filename", "the file includes itself: deck.k -> deck.k"),
        ("*PARAMETER\nxone,1.0\n", 2, "prmr", "'xone' is no name"),
        ("*PARAMETER\nRone,1.0.0\n", 2, "one", "'1.0.0' is no number"),
        ("*PARAMETER_EXPRESSION\nR      one 1/0\n", 2, "one", "cannot be computed"),
        ("*PARAMETER_EXPRESSION\nR      one __import__('os')\n", 2, "one", "cannot be computed"),
        ("*PARAMETER_EXPRESSION\nR      one 9**9**9**9\n", 2, "one", "cannot be computed"),
        ("*DEFINE_TRANSFORMATION\n         3\n    TWIST       1.0\n*INCLUDE_TRANSFORM\nempty.k\n\n\n\n         3\n",
         3, "option", "'TWIST' is not understood"),
        ("*INCLUDE_TRANSFORM\nempty.k\n\n\n\n         3\n", 6, "tranid", "transformation 3 is not defined"),
        ("*INCLUDE_TRANSFORM\nempty.k\n\n\n   1.0     0.0x\n", 5, "fcttim", "is no factor"),
        ("*NODE\n" + "1" * 5000 + "\n", 2, "line", "the line has 5000 characters"),
        ("*NODE\n  \0 1\n", 2, "line", "zero bytes"),
    ],
)  # fmt: skip
def test_a_mistake_names_its_line_its_field_and_what_was_expected(
    tmp_path: Path, text: str, line: int, column: str, match: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text, empty="*KEYWORD\n")
    error = caught.value
    assert match in error.found
    assert (Path(error.file).name, error.line) == ("deck.k", line)
    assert error.column == column or column == "line"
    assert error.expected
    assert error.mend


def test_all_mistakes_come_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputErrors) as caught:
        read(tmp_path, NODES.replace("       3 ", "       x ") + "*MAT_ELASTIC\n         1      dens\n*INCLUDE\nno.k\n")
    assert [(e.line, e.column) for e in caught.value.errors] == [(4, "nid"), (11, "ro"), (13, "filename")]


def test_a_circle_of_includes_ends(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a.k:2: filename: the file includes itself: deck.k -> a.k -> deck.k"):
        read(tmp_path, "*INCLUDE\na.k\n", a="*INCLUDE\ndeck.k\n")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file does not exist"):
        read_keyword(tmp_path / "none.k")


def test_comments_in_another_encoding_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "deck.k"
    path.write_bytes(b"*KEYWORD\n$ Stra\xdfe\n" + (NODES + ONE_LINE).encode())
    assert is_the_cube(read_keyword(path))


def test_numbers_given_twice_are_collisions_and_the_first_holds(tmp_path: Path) -> None:
    again = NODES.replace("*NODE\n", "").replace("1.0", "9.0")
    deck = read(tmp_path, "*KEYWORD\n" + NODES + again + ONE_LINE)
    assert is_the_cube(deck)
    assert [(c.kind, c.number) for c in deck.collisions] == [("node", k) for k in range(1, 9)]
    assert deck.collisions[0].first.endswith("deck.k:3")
    assert deck.collisions[0].second.endswith("deck.k:11")
