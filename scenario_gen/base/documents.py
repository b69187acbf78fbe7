# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""YAML and JSON of others, read with bounds.

Size, depth, no aliases, plain values only, a schema.
"""

from collections.abc import Mapping
from functools import cache
import json
from pathlib import Path
import stat
from typing import Any, NoReturn

from scenario_gen.base.errors import guarded, InputError

MAX_YAML_BYTES = 512 * 1024  # parameters have 9 kB, the metadata of a bag of 1000 topics 500 kB
MAX_JSON_BYTES = 8 * 1024 * 1024  # the figures of one case have 9 kB
MAX_NESTING_LEVELS = 32  # nested lists and mappings
MAX_INTEGER_BITS = 63  # of parameters and stamps
MAX_NUMBER_FACTOR = 1e300  # of a number in JSON: finite, also after some arithmetic
PLAIN = frozenset(
    f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "seq", "map")
)
NUMBER = {"type": "number", "minimum": -MAX_NUMBER_FACTOR, "maximum": MAX_NUMBER_FACTOR}
COUNT = {"type": "integer", "minimum": 0, "maximum": 2**MAX_INTEGER_BITS - 1}


@cache
def _loader() -> Any:
    """Return the class that reads YAML.

    PyYAML is imported with the first document, for the segmentation does not need it.
    """
    import yaml

    class Loader(yaml.CSafeLoader):  # type: ignore[misc]
        """Plain values only: a date is text, `<<` and `=` are keys like others.

        Numbers of more than 64 bits are refused.
        """

        yaml_implicit_resolvers = {  # noqa: RUF012 - as the base declares it
            first: [(tag, pattern) for tag, pattern in known if tag in PLAIN]
            for first, known in yaml.CSafeLoader.yaml_implicit_resolvers.items()
        }

        def construct_yaml_int(self, node: Any) -> int:
            value: int = super().construct_yaml_int(node)
            if value.bit_length() > MAX_INTEGER_BITS:
                raise yaml.constructor.ConstructorError(
                    None, None, "an integer of more than 64 bits", node.start_mark
                )
            return value

    Loader.add_constructor("tag:yaml.org,2002:int", Loader.construct_yaml_int)
    return Loader


def parse_yaml(text: str, source: str) -> Any:
    """Return the value of a YAML text: mappings, lists, texts, numbers, true, false and null.

    Args:
        text: one document.
        source: names it in messages.

    Raises:
        InputError: the text is too long, too deep, has aliases or tags of other kinds, or is no
            YAML.
    """
    import yaml

    if len(text) > MAX_YAML_BYTES:
        raise InputError(
            f"{source}: {len(text)} characters of YAML; at most {MAX_YAML_BYTES} are read"
        )
    try:
        _check_events(text, source)
        return yaml.load(text, Loader=_loader())
    except yaml.YAMLError as error:
        raise InputError(f"{source}: {_yaml_problem(error)}") from error
    except (ValueError, KeyError, IndexError, AttributeError) as error:
        # PyYAML's constructors raise these for `!!int ""` or `!!bool x`.
        raise InputError(
            f"{source}: a value does not suit its tag ({type(error).__name__})"
        ) from error


def _check_events(text: str, source: str) -> None:
    """Check a YAML text's structure before any value is built from it.

    Raises:
        InputError: it is too deep, or has an alias or a tag of another kind.
    """
    import yaml

    depth = 0
    for event in yaml.parse(text, Loader=_loader()):
        place = f"{source}, line {event.start_mark.line + 1}, column {event.start_mark.column + 1}"
        if isinstance(event, yaml.AliasEvent):
            raise InputError(
                f"{place}: the alias *{event.anchor} is not read; write the value out"
            )
        tag = getattr(event, "tag", None)
        if tag not in (None, "!") and tag not in PLAIN:
            raise InputError(
                f"{place}: the tag {tag} is not read; write plain text, numbers, lists and "
                "mappings"
            )
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(
            event, yaml.CollectionEndEvent
        )
        if depth > MAX_NESTING_LEVELS:
            raise InputError(
                f"{place}: lists or mappings nested more than {MAX_NESTING_LEVELS} deep are not "
                "read"
            )


def _yaml_problem(error: Exception) -> str:
    """Return place and problem in one line."""
    mark = getattr(error, "problem_mark", None)
    place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    problem = (
        getattr(error, "problem", None)
        or getattr(error, "reason", None)
        or " ".join(str(error).split())
    )
    return f"not YAML ({place}{problem})"


def read_bytes(path: Path, most: int, source: str, remedy: str = "") -> bytes:
    """Return the content of a regular file of at most `most` bytes.

    `remedy` ends the message about a larger file.

    Raises:
        InputError: it cannot be read, is no regular file, or is too large.
    """
    try:
        # A pipe, if opened, would wait for its writer.
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{source}: not a regular file")
        with path.open("rb") as file:
            data = file.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a name with a null byte
        raise InputError(
            f"{source}: cannot be read ({getattr(error, 'strerror', None) or error})"
        ) from error
    if len(data) > most:
        raise InputError(f"{source}: {path.stat().st_size} bytes; at most {most} are read{remedy}")
    return data


def read_text(path: Path, most: int, source: str) -> str:
    """Return the text of a regular file of at most `most` bytes.

    Raises:
        InputError: as `read_bytes`, or it is not UTF-8.
    """
    try:
        return read_bytes(path, most, source).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: not UTF-8 text (byte {error.start})") from error


def read_yaml(path: Path, source: str = "") -> Any:
    """Return the value of a YAML file, as `parse_yaml` does.

    Raises:
        InputError: likewise, or the file cannot be read.
    """
    source = source or str(path)
    return parse_yaml(read_text(path, MAX_YAML_BYTES, source), source)


def parse_json(text: str, source: str, schema: Mapping[str, Any]) -> Any:
    """Return the value of a JSON text that conforms to a schema.

    Its numbers are finite if the schema uses `NUMBER`.

    Raises:
        InputError: the text is no JSON, or does not conform; the message names the path inside the
            document.
    """

    def refuse(name: str) -> NoReturn:
        raise InputError(f"{source}: {name} is no JSON; write null where there is no number")

    try:
        value = json.loads(text, parse_constant=refuse)
    except RecursionError:
        raise InputError(f"{source}: lists or objects are nested too deep") from None
    except ValueError as error:
        raise InputError(f"{source}: not JSON ({error})") from error
    _check_schema(value, source, schema)
    return value


def read_json(path: Path, schema: Mapping[str, Any]) -> Any:
    """Return the value of a JSON file, as `parse_json` does.

    Raises:
        InputError: likewise, or the file cannot be read.
    """
    source = str(path)
    return parse_json(read_text(path, MAX_JSON_BYTES, source), source, schema)


def _check_schema(value: Any, source: str, schema: Mapping[str, Any]) -> None:
    """Check a value against a JSON schema.

    Raises:
        InputError: it does not conform; the message has the path, the value and the rule.
    """
    import jsonschema  # takes a quarter of a second

    with guarded(source, RecursionError, remedy="lists or objects are nested too deep"):
        error = next(jsonschema.Draft202012Validator(schema).iter_errors(value), None)
    if error is None:
        return
    place = "".join(
        f"[{key}]" if isinstance(key, int) else f".{shown(key, 40)}" for key in error.absolute_path
    ).lstrip(".")
    rule = f"{error.validator} {shown(error.validator_value, 120)}"
    raise InputError(
        f"{source}: {place or 'the document'} is {shown(error.instance, 120)}; its schema asks "
        f"for {rule}"
    )


def shown(value: Any, most: int = 80) -> str:
    """Return a value as text of at most `most` characters, whatever it is."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits, lists in lists
        text = f"a {type(value).__name__}"
    return text if len(text) <= most else f"{text[: most - 1]}…"
