# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""XML documents that are the same bytes for the same content."""

from datetime import datetime, UTC
import math
import xml.etree.ElementTree as ET

from scenario_gen.base.errors import InputError

Element = ET.Element


def number(value: float) -> str:
    """Return a number as xs:decimal and xs:double allow it: no exponent, at most nine decimals.

    Raises:
        InputError: it is not finite.
    """
    if not math.isfinite(value):
        raise InputError(f"cannot export {value}: XML files need finite numbers")
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def add(
    parent: Element, tag: str, text: str | float | None = None, **attributes: str | float
) -> Element:
    """Append an element with attributes and text, and return it; see `number` for numbers.

    Of a path of tags, all elements are appended, each to the one before.
    """
    *outer, tag = tag.split("/")
    for name in outer:
        parent = ET.SubElement(parent, name)
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


def date_of(start_ns: int) -> str:
    """Return a stamp as UTC date and time: the same bag gives the same file."""
    return datetime.fromtimestamp(start_ns // 10**9, UTC).strftime("%Y-%m-%dT%H:%M:%S")


def serialized(root: Element) -> bytes:
    """Return the document as indented UTF-8 bytes."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"
