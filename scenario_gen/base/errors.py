# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The project's errors, their presentation, and the conversion of other errors into them."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import copyreg
from difflib import get_close_matches
import errno
from importlib.util import find_spec
import sys
from typing import Any

MAX_INPUT_CHARACTERS = 500  # of a message about an input; quotations from files have any length
MAX_REFUSAL_CHARACTERS = 2_000  # of a refusal, which may join several reasons
PART_SEPARATOR = "; "
MAX_PARTS_COUNT = 3  # of a long message, from its beginning and from its end
FULL_DISK_ADVICE = "; make room there, or name a place on another disk"


class ScenarioGenError(Exception):
    """Base of the errors that this project raises.

    Its arguments are lines; unprintable characters in them are escaped. The command line prints
    them without a traceback and exits with 2.
    """

    exit_code = 2

    def __reduce__(self) -> tuple[Any, ...]:
        # By default an error is unpickled from its lines alone, but some take further arguments.
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]

    def __str__(self) -> str:
        return "\n".join(printable(str(line)) for line in self.args)


class InputError(ScenarioGenError):
    """A file, row, topic or parameter cannot be used.

    The message may quote the file. So unprintable characters are escaped, and a long message loses
    its middle, so that the place at its beginning and the remedy at its end stay.
    """

    def __init__(self, message: str) -> None:
        super().__init__(presentable(message))


class OutOfRangeError(InputError, IndexError):
    """No element has this number."""


class UnforeseenError(InputError):
    """A reader failed on a file in an unforeseen way: a bug in the reader."""


class BugError(ScenarioGenError):
    """A command failed in an unforeseen way; the message names the file with the traceback."""

    exit_code = 1


class MissingExtraError(ScenarioGenError, ImportError):
    """An optional library is not installed; the message names the extra that installs it."""


def needs(extra: str, *modules: str) -> None:
    """Check that the modules of an extra are installed.

    Args:
        extra: one of the extras in pyproject.toml.
        modules: top-level names, which are not imported.

    Raises:
        MissingExtraError: one is missing.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"{', '.join(missing)} not installed; install it with the extra: "
            f"`pip install '.[{extra}]'` in a checkout, or `pip install 'scenario_gen[{extra}]'`"
        )


def presentable(text: str, max_length: int = MAX_INPUT_CHARACTERS) -> str:
    """Return a message of at most `max_length` printable characters.

    The parts of a long message (reasons and remedies, joined by semicolons) share the length; a
    longer part loses its middle.
    """
    if len(text) > 4 * max_length:  # a quoted field may have megabytes
        text = text[: 2 * max_length] + text[-2 * max_length :]
    text = printable(text)
    if len(text) <= max_length:
        return text
    parts = text.split(PART_SEPARATOR)
    if len(parts) > 2 * MAX_PARTS_COUNT:
        parts = [*parts[:MAX_PARTS_COUNT], "…", *parts[-MAX_PARTS_COUNT:]]
    room = max_length - len(PART_SEPARATOR) * (len(parts) - 1)
    shortest_first = sorted(range(len(parts)), key=lambda k: len(parts[k]))
    for done, k in enumerate(shortest_first):
        parts[k] = _without_middle(parts[k], room // (len(parts) - done))
        room -= len(parts[k])
    return PART_SEPARATOR.join(parts)


def _without_middle(text: str, max_length: int) -> str:
    """Return a text of at most `max_length` characters, cut between words if possible."""
    if len(text) <= max_length:
        return text
    half = (max_length - 3) // 2
    return f"{text[:half].rsplit(' ', 1)[0]} … {text[-half:].split(' ', 1)[-1]}"


class RefusedError(ScenarioGenError):
    """The input is valid but the request is impossible, e.g. a template fits no road."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question with the most similar known name, as the end of a message.

    It is "" if no known name is similar.
    """
    by_lower = {each.lower(): each for each in known}
    similar = get_close_matches(name.lower()[:MAX_INPUT_CHARACTERS], by_lower, n=1, cutoff=0.6)
    return f"; did you mean {by_lower[similar[0]]}?" if similar else ""


def of_system(error: OSError, name: object = None, advice: str = "") -> InputError:
    """Return an OSError as an InputError.

    The file (`name`, or else that of the error), the reason, the advice.
    """
    file = error.filename if name is None else name
    place = "" if file is None else f"{file}: "
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        advice = advice or FULL_DISK_ADVICE
    reason = error.strerror or str(error)
    if isinstance(error, IsADirectoryError):
        reason = "is a folder; name a file"
    return InputError(f"{place}{reason}{advice}")


def printable(text: str) -> str:
    """Return the text with line breaks, control characters and bidi marks escaped as in Python."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def printable_lines(text: str) -> str:
    """Return a text whose line breaks are its own, with the rest escaped as in `printable`."""
    return "\n".join(map(printable, text.split("\n")))


def shown_error(error: Exception) -> str:
    """Return the printed message of an error, each of its lines presentable."""
    return "\n".join(presentable(line, MAX_REFUSAL_CHARACTERS) for line in str(error).split("\n"))


def print_error(error: ScenarioGenError | OSError) -> int:
    """Print the error on standard error; return the exit code."""
    if isinstance(error, OSError):
        error = of_system(error)
    print(f"error: {shown_error(error)}", file=sys.stderr)
    return error.exit_code


@contextmanager
def guarded(where: str, *kinds: type[Exception], remedy: str = "") -> Iterator[None]:
    """Convert a decoding library's exceptions into an InputError.

    The block must only call that library.

    Args:
        where: the file and the place in it; begins the message.
        kinds: the exceptions to convert, by default all: a decoder may fail in any way on damaged
            bytes, and without code of ours in the block no bug of ours is hidden.
        remedy: ends the message.

    Raises:
        InputError: the library failed; the message has `where`, the library's message and
            `remedy`.
    """
    converted = kinds or (Exception,)
    try:
        yield
    except ScenarioGenError:
        raise
    except converted as error:
        raise InputError(
            f"{where}: {describe(error)}" + (f"; {remedy}" if remedy else "")
        ) from error


@contextmanager
def reading(path: object) -> Iterator[None]:
    """Convert an unforeseen exception of a reader into an InputError that names the file.

    It is used once around each reader.

    Unlike in `guarded` the block has code of ours, so the error has its own class, which fuzzing
    reports.

    Raises:
        UnforeseenError: the reader raised neither an error of ours nor an OSError.
    """
    try:
        yield
    except (ScenarioGenError, OSError, MemoryError):
        raise
    except Exception as error:
        raise UnforeseenError(
            f"{path} cannot be read: this is a bug in scenario_gen, even if the file is damaged "
            f"({describe(error)}); report it and attach {path}"
        ) from error


def describe(error: BaseException) -> str:
    """Return the message of an error in one line.

    A message of at most one word gets the error's class.
    """
    if isinstance(error, MemoryError):
        return "asks for more memory than there is"
    text = " ".join(str((isinstance(error, OSError) and error.strerror) or error).split())
    return text if len(text.split()) > 1 else f"{type(error).__name__} {text}".strip()
