# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO files as they are meant: values for parameters and expressions, entries for references to catalogs.

Source: ASAM OpenSCENARIO XML 1.2, "Parameters", "Expressions", "Catalogs".
"""

import ast
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
import math
import operator
from pathlib import Path
import re

from scenario_gen.base.errors import InputError
from scenario_gen.base.markup import Element, read_xml

MOST_FILES = 100  # of a catalog's folder
_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: math.fmod,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name)
    for name in ("floor", "ceil", "sqrt", "pow", "sin", "cos", "tan", "asin", "acos", "atan")
} | {"round": round, "abs": abs, "max": max, "min": min}
_NO_VALUE = (
    KeyError,
    TypeError,
    ValueError,
    SyntaxError,
    ArithmeticError,
    RecursionError,
    MemoryError,
)

Catalogs = Mapping[tuple[str, str], Element]
"""Entries by the names of their catalog and their own."""


def resolved(root: Element, path: Path) -> Element:
    """Return the root of a file with values and entries in place; what is declared nowhere, or in no catalog, stays as it is.

    Args:
        root: as it stands in the file.
        path: of the file, from which the folders of catalogs are counted.
    """
    return _resolved(root, {}, dict(_entries(root, path.parent)))


def _entries(root: Element, folder: Path) -> Iterator[tuple[tuple[str, str], Element]]:
    """Yield the entries of all catalogs in the folders that a file names."""
    for location in (
        location for locations in root.all("CatalogLocations") for location in locations.children
    ):
        for directory in location.all("Directory"):
            for file in sorted((folder / directory.attributes.get("path", "")).glob("*.xosc"))[
                :MOST_FILES
            ]:
                with suppress(InputError):  # a file beside those that are needed
                    for catalog in read_xml(file, str(file)).all("Catalog"):
                        yield from (
                            ((catalog.get("name"), entry.get("name")), entry)
                            for entry in catalog.children
                        )


def _resolved(
    element: Element,
    scope: Mapping[str, str],
    catalogs: Catalogs,
    assigned: Mapping[str, str] = {},
) -> Element:
    own = dict(scope)
    declared = element.all("ParameterDeclarations/ParameterDeclaration")
    for each in (
        *declared,
        *declared,
    ):  # twice: one may stand before another one of which it is made
        own[each.get("name")] = value_of(each.get("value"), own)
    own |= assigned
    children = []
    for child in element.children:
        catalog, entry = (
            value_of(child.attributes.get(key, ""), own) for key in ("catalogName", "entryName")
        )
        if child.tag == "CatalogReference" and (catalog, entry) in catalogs:
            values = child.all("ParameterAssignments/ParameterAssignment")
            given = {each.get("parameterRef"): value_of(each.get("value"), own) for each in values}
            children.append(_resolved(catalogs[catalog, entry], {}, {}, given))
        else:
            children.append(_resolved(child, own, catalogs))
    attributes = {key: value_of(text, own) for key, text in element.attributes.items()}
    return replace(element, attributes=attributes, children=children)


def value_of(text: str, scope: Mapping[str, str]) -> str:
    """Return what an attribute's text means: of a parameter ($name) or an expression (${…}) its value, else the text itself."""
    if not text.startswith("$"):
        return text
    if not (text.startswith("${") and text.endswith("}")):
        return scope.get(text[1:], text)
    try:
        return repr(
            _number(
                ast.parse(re.sub(r"\$(?=\w)", "", text[2:-1]).strip(), mode="eval").body, scope
            )
        )
    except _NO_VALUE:
        return text


def _number(node: ast.expr, scope: Mapping[str, str]) -> float:
    """The value of an expression; a KeyError, TypeError or ValueError if it is none of numbers."""
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return math.pi if name == "pi" and name not in scope else float(scope[name])
        case ast.UnaryOp(op=sign, operand=operand):
            return _OPERATORS[type(sign)](_number(operand, scope))
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATORS[type(sign)](_number(left, scope), _number(right, scope))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return float(_FUNCTIONS[name](*(_number(argument, scope) for argument in arguments)))
    raise ValueError(node)
