# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""XML written the same each time, and read without what harms: no entities, bounded in size, wrong places named."""

from collections.abc import Iterable
from pathlib import Path
import xml.etree.ElementTree as ET
from xml.parsers import expat

import numpy as np

from scenario_gen.base.errors import InputError, of_system

Element = ET.Element
MOST_BYTES = 256 * 2**20
DECIMALS = 9


def number(value: float) -> str:
    """Return a number as xs:decimal and xs:double take it: no exponent, at most nine decimals, no trailing zeros.

    Raises:
        InputError: it is not finite.
    """
    if not np.isfinite(value):
        raise InputError(f"{value} cannot be exported: a number that is not finite has no decimal form")
    text = f"{float(value):.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def add(parent: Element, tag: str, text: str | float | None = None, **attributes: str | float) -> Element:
    """Append an element with attributes and text, and return it; numbers are written by `number`."""
    element = ET.SubElement(parent, tag, {key: _text(value) for key, value in attributes.items()})
    if text is not None:
        element.text = _text(text)
    return element


def _text(value: str | float) -> str:
    if isinstance(value, str):
        return "".join(c if c.isprintable() else " " for c in value)
    return str(value) if isinstance(value, int) else number(value)


def comment(parent: Element, text: str) -> None:
    """Append a comment."""
    parent.append(ET.Comment(f" {_text(text).replace('--', '- -')} "))


def serialized(root: Element) -> bytes:
    """Return the document as UTF-8 bytes, indented."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"


def read_xml(path: Path, most_bytes: int = MOST_BYTES) -> Element:
    """Return the root of a document.

    Raises:
        InputError: the file cannot be read, is larger than `most_bytes`, is no well-formed XML, or declares a document type or
            entities, by which a small file can become a large one or reach for others.
    """
    try:
        size = path.stat().st_size
        if size > most_bytes:
            raise InputError(f"{path} has {size} bytes; at most {most_bytes} are read")
        data = path.read_bytes()
    except OSError as error:
        raise of_system(error, path) from error
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise InputError(
            f"{path}:{parser.CurrentLineNumber}: declares a document type or an entity, which is not read; remove it"
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise InputError(f"{path}:{error.lineno}: no well-formed XML: {expat.ErrorString(error.code)}") from error
    except (LookupError, ValueError) as error:  # an encoding that is unknown or another one
        raise InputError(f"{path}: cannot be decoded: {error}") from error
    return builder.close()


class Place:
    """An element of a file that is read; what is missing or no number is an error that names file and element."""

    def __init__(self, path: Path, element: Element, name: str) -> None:
        """Take the file, the element, and how it is called in messages."""
        self.path, self.element, self.name = path, element, name

    def error(self, what: str) -> InputError:
        """Return an error about this place."""
        return InputError(f"{self.path}: {self.name}: {what}")

    def child(self, way: str) -> "Place":
        """Return the one element that a path of tags leads to.

        Raises:
            InputError: there is none.
        """
        element = self.element.find(way)
        if element is None:
            raise self.error(f"no element {way}")
        return Place(self.path, element, f"{self.name}/{way}")

    def all(self, way: str, key: str = "id") -> Iterable["Place"]:
        """Yield every element that a path of tags leads to."""
        for k, element in enumerate(self.element.findall(way)):
            yield Place(self.path, element, f"{self.name}/{way}[{element.get(key, str(k + 1))}]")

    def value(self, way: str = "") -> float:
        """Return the number in the text of the element that a path leads to.

        Raises:
            InputError: there is none, or it is no finite number.
        """
        place = self.child(way) if way else self
        return place._number(place.element.text or "", "its text")

    def attribute(self, name: str, default: float | None = None) -> float:
        """Return the number in an attribute; `default`, if there is one, where it is missing.

        Raises:
            InputError: it is missing, or no finite number.
        """
        text = self.element.get(name)
        if text is None:
            if default is None:
                raise self.error(f"no attribute {name}")
            return default
        return self._number(text, name)

    def text(self, name: str) -> str:
        """Return an attribute.

        Raises:
            InputError: it is missing.
        """
        text = self.element.get(name)
        if text is None:
            raise self.error(f"no attribute {name}")
        return text

    def _number(self, text: str, what: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise self.error(f"{what} is {text[:40]!r}, no finite number")
        return value
