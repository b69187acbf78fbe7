# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""XML files from other programs, parsed by lxml within bounds on size, elements and entities."""

from collections.abc import Iterator
import math
from pathlib import Path
import re
from typing import TYPE_CHECKING

from lxml import etree

from scenario_gen.base.documents import read_bytes, shown
from scenario_gen.base.errors import InputError

MAX_XML_BYTES = 128 << 20
"""A town of 100 roads has 0.5 MB in OpenDRIVE, a district has 20 MB in Lanelet2."""

MAX_ELEMENT_COUNT = 2_000_000
MAX_COORDINATE_M = 1e8
"""Bound of all numbers in a file; every geodetic grid stays within it."""

_DECLARATION_BELOW_COMMENTS = re.compile(rb"((?:\s|<!--.*?-->)+)(<\?xml.*?\?>)", re.DOTALL)


class Element(etree.ElementBase):  # type: ignore[misc]  # lxml has no type stubs
    """An lxml element whose checked accessors name file and line in their errors.

    Compare with None (`element is not None`): an element without children is false.
    """

    if TYPE_CHECKING:  # lxml's types

        def __iter__(self) -> Iterator["Element"]: ...
        def find(self, path: str) -> "Element | None": ...  # noqa: D102
        def findall(self, path: str) -> list["Element"]: ...  # noqa: D102

    @property
    def file(self) -> str:
        """Name of the file in messages: that of the document, or `base` of an inserted element."""
        base = self.xpath("string(ancestor-or-self::*[@xml:base][1]/@xml:base)")
        return str(base or self.getroottree().docinfo.URL)

    @property
    def place(self) -> str:
        """File, line and tag: the beginning of a message."""
        return f"{self.file}, line {self.sourceline}, <{self.tag}>"

    @property
    def content(self) -> str:
        """Text before the first child, without the white space around it."""
        return (self.text or "").strip()

    def first_of(self, *paths: str) -> "Element | None":
        """Return the first descendant along the first path of tags that exists, or None."""
        return next((e for e in map(self.find, paths) if e is not None), None)

    def child(self, path: str) -> "Element":
        """Return the first descendant along a path of tags (`a/b`).

        Raises:
            InputError: there is none.
        """
        element: Element = self
        for tag in path.split("/"):
            descendant = element.find(tag)
            if descendant is None:
                raise InputError(f"{element.place} has no <{tag}>")
            element = descendant
        return element

    def attribute(self, name: str) -> str:
        """Return an attribute.

        Raises:
            InputError: it is missing.
        """
        if name not in self.attrib:
            raise InputError(f"{self.place} has no attribute {name}")
        return str(self.attrib[name])

    def number(self, name: str, default: float | None = None) -> float:
        """Return an attribute as a number of at most `MAX_COORDINATE_M`.

        Raises:
            InputError: it is not such a number, or it is missing and has no default.
        """
        if default is not None and name not in self.attrib:
            return default
        return to_number(self.attribute(name), f"{self.place}, attribute {name}")

    def value(self) -> float:
        """Return the content as a number of at most `MAX_COORDINATE_M`.

        Raises:
            InputError: it is not such a number.
        """
        return to_number(self.content, self.place)


def to_number(text: str, where: str) -> float:
    """Return a text as a number of at most `MAX_COORDINATE_M`.

    Raises:
        InputError: it is not such a number; the message begins with `where`.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= MAX_COORDINATE_M:
        raise InputError(
            f"{where}: {shown(text, 40)!r} is not a number between "
            f"-{MAX_COORDINATE_M:g} and {MAX_COORDINATE_M:g}"
        )
    return number


def read_xml(path: Path, label: str) -> Element:
    """Return the root element of an XML file.

    Args:
        path: the file.
        label: its name in messages.

    Raises:
        InputError: the file cannot be read, or as `parse_xml`.
    """
    data = read_bytes(path, MAX_XML_BYTES, label, ": cut the map")
    if not data.strip():
        raise InputError(f"{label} is empty")

    misplaced = _DECLARATION_BELOW_COMMENTS.match(data)
    if misplaced:  # the declaration moves to the beginning; lines keep their numbers
        data = misplaced[2] + misplaced[1] + data[misplaced.end() :]
    return parse_xml(data, label)


def parse_xml(data: bytes, label: str) -> Element:
    """Return the root element of an XML document; tags and attributes lose their namespaces.

    Raises:
        InputError: the document has too many elements, declares a document type, or is not
            well-formed; the message names line and column.
    """
    if data.count(b"<") > 2 * MAX_ELEMENT_COUNT:  # a start tag and an end tag
        raise InputError(f"{label}: more than {MAX_ELEMENT_COUNT} elements; cut the map")

    parser = etree.XMLParser(  # collect_ids must stay True: False loads external DTDs
        resolve_entities=False,
        no_network=True,
        huge_tree=False,  # bounds depth, length of texts, and growth by entities
        remove_comments=True,
        remove_pis=True,
    )
    parser.set_element_class_lookup(etree.ElementDefaultClassLookup(element=Element))
    try:
        root: Element = etree.fromstring(data, parser, base_url=label)
    except etree.XMLSyntaxError as error:
        line, column = error.position
        problem = str(error.msg).partition(f", line {line}")[0].strip()
        raise InputError(f"{label}, line {line}, column {column}: not XML ({problem})") from error

    if root.getroottree().docinfo.doctype:
        line = data[: data.find(b"<!DOCTYPE")].count(b"\n") + 1
        raise InputError(
            f"{label}, line {line}: document types can define entities and are not read; "
            "delete <!DOCTYPE …>"
        )
    if b"xmlns" in data:
        _remove_namespaces(root)
    return root


def _remove_namespaces(root: Element) -> None:
    """Replace each qualified tag and attribute by its local name."""
    for element in root.iter(etree.Element):
        element.tag = etree.QName(element).localname
        for name, value in element.attrib.items():
            local_name = etree.QName(name).localname
            if local_name != name:
                del element.attrib[name]
                element.set(local_name, value)
