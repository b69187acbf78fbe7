# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""XML of others, read with bounds: size, elements, depth; no document types, and so no entities defined in a file."""

from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any
from xml.parsers import expat

from scenario_gen.base.documents import read_bytes, shown
from scenario_gen.base.errors import InputError

MOST_BYTES = (
    128 * 1024 * 1024
)  # of a map; a town of 100 roads takes 0.5 MB in OpenDRIVE, a district in Lanelet2 20 MB
MOST_ELEMENTS = 2_000_000
DEEPEST = 64
LARGEST = (
    1e8  # of a coordinate or length: metres from a frame's origin, more than any geodetic grid has
)


@dataclass(slots=True)
class Element:
    """An element and the line of the file that it begins on."""

    tag: str
    attributes: dict[str, str]
    line: int
    file: str
    text: str = ""
    children: list["Element"] = field(default_factory=list)

    @property
    def place(self) -> str:
        """File, line and tag, to begin a message with."""
        return f"{self.file}, line {self.line}, <{self.tag}>"

    def all(self, tag: str) -> list["Element"]:
        """Return the children of that name, or the descendants along a path of names (a/b)."""
        tag, _, rest = tag.partition("/")
        found = [child for child in self.children if child.tag == tag]
        return [below for child in found for below in child.all(rest)] if rest else found

    def first(self, *path: str) -> "Element | None":
        """Return the first descendant along a path of names, None if there is none."""
        at: Element | None = self
        for tag in path:
            at = next((child for child in at.children if child.tag == tag), None) if at else None
        return at

    def one(self, tag: str) -> "Element":
        """Return the first child of that name, or the first one along a path of names (a/b).

        Raises:
            InputError: there is none.
        """
        tag, _, rest = tag.partition("/")
        element = self.first(tag)
        if element is None:
            raise InputError(f"{self.place} has no <{tag}>")
        return element.one(rest) if rest else element

    def get(self, name: str) -> str:
        """Return an attribute.

        Raises:
            InputError: it is missing.
        """
        if name not in self.attributes:
            raise InputError(f"{self.place} has no attribute {name}")
        return self.attributes[name]

    def number(self, name: str, default: float | None = None) -> float:
        """Return an attribute as a finite number of at most `LARGEST`.

        Raises:
            InputError: it is none, or is missing and has no default.
        """
        if default is not None and name not in self.attributes:
            return default
        return finite(self.get(name), f"{self.place}, attribute {name}")

    def value(self) -> float:
        """Return the text as a finite number of at most `LARGEST`.

        Raises:
            InputError: it is none.
        """
        return finite(self.text.strip(), self.place)


def finite(text: str, where: str) -> float:
    """Return a text as a finite number of at most `LARGEST`.

    Raises:
        InputError: it is none; begins with `where`.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= LARGEST:
        raise InputError(
            f"{where}: {shown(text, 40)!r} is no number from -{LARGEST:g} to {LARGEST:g}"
        )
    return number


def has_root(path: Path, tag: str, *suffixes: str) -> bool:
    """Return whether a file's name ends with one of these suffixes, and an element of that name is in its beginning."""
    if path.suffix.lower() not in suffixes:
        return False
    with path.open("rb") as file:
        return f"<{tag}".encode() in file.read(4096)


def read_xml(path: Path, what: str, skip: frozenset[str] = frozenset()) -> Element:
    """Return the root element of an XML file.

    Args:
        path: the file.
        what: names it in messages.
        skip: names of elements that are passed over with their content.

    Raises:
        InputError: it cannot be read, is too large or deep, declares a document type, or is no XML; names line and column.
    """
    data = read_bytes(path, MOST_BYTES, what, ": cut the map")
    if not data.strip():
        raise InputError(f"{what} is empty")
    if above := re.match(
        rb"((?:\s|<!--.*?-->)+)(<\?xml.*?\?>)", data, re.DOTALL
    ):  # moves below it: lines keep their numbers
        data = above[2] + above[1] + data[above.end() :]
    return parse_xml(data, what, skip)


def parse_xml(data: bytes, what: str, skip: frozenset[str] = frozenset()) -> Element:
    """Return the root element of XML in memory; arguments as in `read_xml`.

    Raises:
        InputError: as there.
    """
    parser: Any = expat.ParserCreate()
    parser.buffer_text = True
    root = Element("", {}, 0, what)
    stack = [root]
    count = skipped = 0

    def place() -> str:
        return f"{what}, line {parser.CurrentLineNumber}, column {parser.CurrentColumnNumber + 1}"

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, skipped
        count += 1
        if count > MOST_ELEMENTS:
            raise InputError(f"{place()}: more than {MOST_ELEMENTS} elements; cut the map")
        if skipped or tag in skip:
            skipped += 1
        elif len(stack) > DEEPEST:
            raise InputError(f"{place()}: elements nested more than {DEEPEST} deep are not read")
        else:
            element = Element(tag, attributes, parser.CurrentLineNumber, what)
            stack[-1].children.append(element)
            stack.append(element)

    def end(_tag: str) -> None:
        nonlocal skipped
        if skipped:
            skipped -= 1
        else:
            stack.pop()

    def text(data: str) -> None:
        if not skipped:
            stack[-1].text += data

    def refuse(name: str, *_: Any) -> None:
        raise InputError(
            f"{place()}: the document type {shown(name, 40)!r} is not read, for it can declare entities; delete it"
        )

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = (
        start,
        end,
        text,
    )
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem = expat.errors.messages.get(error.code, str(error))
        raise InputError(
            f"{what}, line {error.lineno}, column {error.offset + 1}: not XML ({problem})"
        ) from error
    except (ValueError, LookupError) as error:  # an encoding that Python lacks
        raise InputError(f"{what}: not XML that can be read ({error})") from error
    return root.children[0]
