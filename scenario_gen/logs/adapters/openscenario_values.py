# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters, expressions and catalog references of OpenSCENARIO files, replaced by their values.

Source: ASAM OpenSCENARIO XML 1.2, "Parameters", "Expressions", "Catalogs".
"""

import ast
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from copy import deepcopy
import math
import operator
from pathlib import Path
import re

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml

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
_EVALUATION_ERRORS = (
    KeyError,
    TypeError,
    ValueError,
    SyntaxError,
    ArithmeticError,
    RecursionError,
    MemoryError,
)

Catalogs = Mapping[tuple[str, str], Element]
"""Catalog entries by the names of catalog and entry."""


def resolve_references(root: Element, path: Path) -> None:
    """Replace parameters, expressions and catalog references by their values, in place.

    A parameter that is not declared, or an entry that is in no catalog, stays unchanged.

    Args:
        root: the root element.
        path: its file; catalog folders are relative to it.
    """
    _resolve(root, {}, dict(_catalog_entries(root, path.parent)))


def _catalog_entries(root: Element, folder: Path) -> Iterator[tuple[tuple[str, str], Element]]:
    """Yield the entries of the catalogs in all folders that the file names."""
    for directory in root.findall("CatalogLocations/*/Directory"):
        files = sorted((folder / directory.get("path", "")).glob("*.xosc"))
        for file in files[:100]:
            with suppress(InputError):  # the folder may have other files, too
                yield from _entries_in(read_xml(file, str(file)))


def _entries_in(root: Element) -> Iterator[tuple[tuple[str, str], Element]]:
    """Yield the entries of the catalogs in a file, with the names of catalog and entry."""
    for catalog in root.findall("Catalog"):
        for entry in catalog:
            yield (catalog.attribute("name"), entry.attribute("name")), entry


def _resolve(
    element: Element,
    scope: Mapping[str, str],
    catalogs: Catalogs,
    assigned: Mapping[str, str] = {},
) -> None:
    """Resolve an element and its descendants; `assigned` overrides declared parameters."""
    scope = {**_declared_parameters(element, scope), **assigned}
    for name, text in element.attrib.items():
        element.set(name, value_of(text, scope))

    for child in list(element):
        names = child.get("catalogName", ""), child.get("entryName", "")
        entry = catalogs.get((value_of(names[0], scope), value_of(names[1], scope)))
        if child.tag != "CatalogReference" or entry is None:
            _resolve(child, scope, catalogs)
            continue
        arguments = {
            argument.attribute("parameterRef"): value_of(argument.attribute("value"), scope)
            for argument in child.findall("ParameterAssignments/ParameterAssignment")
        }
        copy = deepcopy(entry)
        copy.base = entry.file  # messages name the catalog
        element.replace(child, copy)
        _resolve(copy, {}, {}, arguments)


def _declared_parameters(element: Element, scope: Mapping[str, str]) -> dict[str, str]:
    """Return the parameters of the scope, and those that the element declares."""
    parameters = dict(scope)
    declared = element.findall("ParameterDeclarations/ParameterDeclaration")
    for declaration in declared * 2:  # the first one may refer to the second one
        text = declaration.attribute("value")
        parameters[declaration.attribute("name")] = value_of(text, parameters)
    return parameters


def value_of(text: str, scope: Mapping[str, str]) -> str:
    """Return the value of an attribute: `$name`, `${expression}` or plain text."""
    if not text.startswith("$"):
        return text
    if not (text.startswith("${") and text.endswith("}")):
        return scope.get(text[1:], text)
    expression = re.sub(r"\$(?=\w)", "", text[2:-1]).strip()
    try:
        return repr(_number(ast.parse(expression, mode="eval").body, scope))
    except _EVALUATION_ERRORS:
        return text


def _number(node: ast.expr, scope: Mapping[str, str]) -> float:
    """Return the value of an expression.

    Raises:
        KeyError, TypeError, ValueError: it is not an expression of numbers.
    """
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
