# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dataclasses ⇄ JSON in a std_msgs/String, field by field, for what no standard message describes.

A field that has its default is left out. NaN is null, an array is nested lists, an enumeration its
value, a note its kind and its sentence. Numbers are exact. Spaces may follow.

A document names the messages that it belongs to by their hashes. Equal stamps alone do not show
it: a second map, segmentation or reading of the log has the stamp of the first.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, is_dataclass, MISSING
from enum import Enum
from functools import cache
import hashlib
import json
import math
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints, TypeVar

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import STRING
from scenario_gen.base.errors import guarded
from scenario_gen.types import Note, note_kinds, recorded_notes

TYPE = "std_msgs/msg/String"
HASH_DIGITS = 12
LANES, PLAN = "road/lanes", "fit/info"
DOCUMENTS = (LANES, PLAN)
_DAMAGES = (AttributeError, LookupError, OverflowError, RecursionError, TypeError, ValueError)
Document = TypeVar("Document")


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def encode_document(value: Any) -> bytes:
    """Return a dataclass as CDR bytes of a String.

    Raises:
        InputError: a number is infinite.
    """
    with guarded("a message cannot hold it", ValueError):
        text = json.dumps(plain(value), ensure_ascii=False, allow_nan=False)
    text += " " * (-(len(text.encode()) + 1) % 4)  # DDS pads messages to a multiple of 4 bytes
    return encode(STRING, data=text)


def decode_document(kind: type[Document], data: bytes, source: str) -> Document:
    """Return the dataclass of a message.

    Raises:
        InputError: naming `source`, it is damaged, or no such document.
    """
    return document_of(kind, json_of(data, source), source)


def json_of(data: bytes, source: str) -> Mapping[str, Any]:
    """Return the members of the object in a message.

    Raises:
        InputError: naming `source`, it is damaged, or no object.
    """
    text = decode(STRING, data, source).data
    with guarded(f"{source}: no JSON", *_DAMAGES):
        return dict(json.loads(text))


def document_of(kind: type[Document], values: Mapping[str, Any], source: str) -> Document:
    """Return the dataclass with these members; others are ignored.

    Raises:
        InputError: naming `source`, a member is missing or damaged.
    """
    with guarded(f"{source}: no {kind.__name__}", *_DAMAGES):
        result: Document = typed(kind, values)
        return result


def short_hash(data: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of some bytes."""
    return hashlib.sha256(data).hexdigest()[:HASH_DIGITS]


def plain(value: Any) -> Any:
    """Return a value as what JSON has."""
    if isinstance(value, Note):
        return [note_kinds([value]), str(value)]
    if is_dataclass(value):
        return _members(value)
    if isinstance(value, np.ndarray):
        return plain([] if _is_unknown(value) else value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, Collection) and not isinstance(value, str):
        items = sorted(value) if isinstance(value, frozenset) else value
        return [*map(plain, items)]
    return None if isinstance(value, float) and math.isnan(value) else value


def _members(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that differ from their defaults, as what JSON has."""
    values = {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    defaults = _defaults(value.__class__)
    return {key: each for key, each in values.items() if each != defaults.get(key, MISSING)}


def _is_unknown(values: Any) -> bool:
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


@cache
def _defaults(kind: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that have defaults, as what JSON has."""
    defaults = {}
    for each in fields(kind):
        if each.default is not MISSING:
            defaults[each.name] = plain(each.default)
        elif each.default_factory is not MISSING:
            defaults[each.name] = plain(each.default_factory())
    return defaults


def typed(kind: Any, value: Any) -> Any:
    """Return a value of JSON as a value of a type.

    Raises:
        InputError, LookupError, TypeError, ValueError, OverflowError: it is none.
    """
    if kind is Any:
        return value
    if kind is Note:
        return recorded_notes([str(value[1])], str(value[0]))[0]
    if is_dataclass(kind):
        return _dataclass(kind, value)
    if get_origin(kind) is not None:
        return _collection(get_origin(kind), get_args(kind), value)
    if issubclass(kind, tuple):  # named
        kinds = tuple(_hints(kind).values())
        return kind(*(typed(each, item) for each, item in zip(kinds, value, strict=True)))
    return _single(kind, value)


def _dataclass(kind: Any, values: Mapping[str, Any]) -> Any:
    """Return a dataclass; other values are ignored."""
    hints = _hints(kind)
    known = {key: value for key, value in values.items() if key in hints}
    return kind(**{key: typed(hints[key], value) for key, value in known.items()})


def _collection(origin: Any, inner: tuple[Any, ...], value: Any) -> Any:
    """Return a value of JSON as an array, a tuple, a set, a mapping, or what may be missing."""
    if origin is UnionType:
        return None if value is None else typed(inner[0], value)
    if origin is np.ndarray:
        values = np.array(value, dtype=get_args(inner[1])[0])
        if np.isinf(values).any():
            raise ValueError("a number is not finite")
        return values
    if origin in (tuple, frozenset):
        kinds = [inner[0]] * len(value) if origin is frozenset or inner[-1] is ... else inner
        return origin(typed(each, item) for each, item in zip(kinds, value, strict=True))
    return {str(key): typed(inner[1], each) for key, each in value.items()}


def _single(kind: Any, value: Any) -> Any:
    """Return a value of JSON as a number, a text, a truth or a member of an enumeration."""
    if kind is float:
        number = math.nan if value is None else float(value)
        if math.isinf(number):
            raise ValueError("a number is not finite")
        return number
    if issubclass(kind, Enum):
        return kind(value)
    if type(value) is not kind:
        raise TypeError(f"{value!r:.40} is no {kind.__name__}")
    return value


@dataclass(frozen=True)
class Head:
    """What every document has: its stamp [ns], and the hashes of its inputs by topic."""

    stamp: int
    inputs: Mapping[str, str]


def head_of(data: bytes, source: str) -> Head:
    """Return the head of a document.

    Raises:
        InputError: it is damaged.
    """
    return decode_document(Head, data, source)


def hash_of(topic: str, data: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a message's CDR bytes.

    The stamps of a map are excluded, so that equal maps for different templates have one hash.
    DDS's padding is excluded; it adds up to 3 bytes to a map or a document.
    """
    if topic in DOCUMENTS:
        data = data[: 8 + int.from_bytes(data[4:8], "little")]
    if topic == "map":
        data = _without_stamps(data)
    return short_hash(data)


def _without_stamps(grid: bytes) -> bytes:
    """Return the bytes of a map without stamp, load time and padding.

    A damaged map gives some of its bytes.
    """
    load_time = 16 + int.from_bytes(grid[12:16], "little")  # after the frame, aligned to 4
    load_time += -load_time % 4
    # After resolution, width and height, aligned to 8 from the end of the encapsulation header.
    origin = load_time + 20
    origin += -(origin - 4) % 8
    cells = origin + 60
    end = cells + int.from_bytes(grid[cells - 4 : cells], "little")
    return grid[:4] + grid[12:load_time] + grid[load_time + 8 : end]
