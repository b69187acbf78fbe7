# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""XML documents by templates; they are the same bytes for the same content."""

from datetime import datetime, UTC
from functools import cache
import math
from typing import Any
import xml.etree.ElementTree as ET

from jinja2 import Environment
from markupsafe import Markup

from scenario_gen.base.errors import InputError
from scenario_gen.output.report.html import xml_environment


def number(value: float) -> str:
    """Return a number as xs:decimal and xs:double allow it: no exponent, at most nine decimals.

    Raises:
        InputError: it is not finite.
    """
    if not math.isfinite(value):
        raise InputError(f"cannot export {value}: XML files need finite numbers")
    text = f"{value:.9f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _text(value: str | float) -> str:
    if isinstance(value, float):
        return number(value)
    if isinstance(value, Markup | int):  # of a macro
        return str(value) if isinstance(value, int) else value
    return "".join(c if c.isprintable() else " " for c in value)


def _comment(text: str) -> Markup:
    return Markup(f"<!-- {_text(text).replace('--', '- -')} -->")


def date_of(start_ns: int) -> str:
    """Return a stamp as UTC date and time: the same bag gives the same file."""
    return datetime.fromtimestamp(start_ns // 10**9, UTC).strftime("%Y-%m-%dT%H:%M:%S")


@cache
def _environment() -> Environment:
    """Return the environment, which compiles each template once."""
    environment = xml_environment(_text)
    environment.filters |= {"comment": _comment, "number": number}
    return environment


def rendered(template: str, **values: Any) -> bytes:
    """Return a document as indented UTF-8 bytes.

    Args:
        template: a Jinja template among the assets of pages. White space in it has no effect,
            numbers are written by `number`, and the filter `comment` makes a comment.
        values: the variables of the template.

    Raises:
        InputError: a number is not finite.
    """
    text = _environment().get_template(template).render(**values)
    builder = ET.TreeBuilder(insert_comments=True)
    root = ET.fromstring(text, ET.XMLParser(target=builder))
    for element in root.iter():
        if not (element.text or "").strip():
            element.text = None
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"
