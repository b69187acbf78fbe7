# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The errors of the project, how they are shown, and how errors of libraries become ours."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
import errno
from importlib.util import find_spec
import sys

LONGEST = 500  # characters of a message about an input: what is quoted from a broken file may be of any length
LONGEST_REFUSAL = 2_000  # characters of a refusal, which may join several reasons
JOIN, MOST_PARTS = "; ", 3  # of a message; so many from its beginning, and from its end, are kept
ROOM = "; make room there, or name a place on another disk"


class ScenarioGenError(Exception):
    """Base of every error this project raises on purpose; the command line prints it without a traceback and exits with 2."""

    exit_code = 2


class InputError(ScenarioGenError):
    """A file, row, topic or parameter cannot be used as it is.

    The message may quote the file, so it is made presentable: characters that do not print are escaped, and the middle of a long
    message is left out, so that the place at its beginning and the remedy at its end stay.
    """

    def __init__(self, message: str) -> None:
        super().__init__(presentable(message))


class UnforeseenError(InputError):
    """A reader failed on a file in an unforeseen way; its cause is a fault of the reader."""


class MissingExtraError(ScenarioGenError, ImportError):
    """A library that only some uses need is not installed; the message names the extra that installs it."""


def needs(extra: str, *modules: str) -> None:
    """Check that the modules of an extra are installed.

    Args:
        extra: one of the extras in pyproject.toml.
        modules: top-level names; they are looked for, not imported.

    Raises:
        MissingExtraError: one is missing.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"{', '.join(missing)} not installed; `pip install 'scenario_gen[{extra}]'` brings it"
        )


def presentable(text: str, longest: int = LONGEST) -> str:
    """Return a message with at most `longest` characters, all of which print, or are line breaks.

    Of a long one each part (a reason, a remedy; a semicolon joins them) has its share, and loses its middle where that is less.
    """
    if len(text) > 4 * longest:  # a first cut, for a quoted field may hold megabytes
        text = text[: 2 * longest] + text[-2 * longest :]
    text = printable(text)
    if len(text) <= longest:
        return text
    parts = text.split(JOIN)
    if len(parts) > 2 * MOST_PARTS:
        parts = [*parts[:MOST_PARTS], "…", *parts[-MOST_PARTS:]]
    room = longest - len(JOIN) * (len(parts) - 1)
    shortest_first = sorted(range(len(parts)), key=lambda k: len(parts[k]))
    for done, k in enumerate(shortest_first):
        parts[k] = _without_middle(parts[k], room // (len(parts) - done))
        room -= len(parts[k])
    return JOIN.join(parts)


def _without_middle(text: str, longest: int) -> str:
    """Return a text with at most `longest` characters, cut between words where it has any."""
    if len(text) <= longest:
        return text
    half = (longest - 3) // 2
    return f"{text[:half].rsplit(' ', 1)[0]} … {text[-half:].split(' ', 1)[-1]}"


class RefusedError(ScenarioGenError):
    """The input is sound but the request cannot be met with it, e.g. a template that fits no road."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question that names the known name nearest to an unknown one, to be put behind a message; "" if none is near."""
    by_lower = {one.lower(): one for one in known}
    near = get_close_matches(name.lower()[:LONGEST], by_lower, n=1, cutoff=0.6)
    return f"; did you mean {by_lower[near[0]]}?" if near else ""


def of_system(error: OSError, name: object = None, advice: str = "") -> InputError:
    """Return an error of the operating system as one of ours: file (`name`, or the one it names itself), reason, advice."""
    file = error.filename if name is None else name
    place = "" if file is None else f"{file}: "
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        advice = advice or ROOM
    reason = (
        "is a folder; name a file"
        if isinstance(error, IsADirectoryError)
        else error.strerror or error
    )
    return InputError(f"{place}{reason}{advice}")


def printable(text: str) -> str:
    """Return the text with characters that control a terminal (also bidi marks) written as in Python source."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


def shown_error(error: Exception) -> str:
    """Return the message of an error as it is printed; of one of many lines, say a refusal each, every line is presentable."""
    return "\n".join(presentable(line, LONGEST_REFUSAL) for line in str(error).split("\n"))


def print_error(error: ScenarioGenError | OSError) -> int:
    """Print the error on standard error; return the exit code."""
    own = of_system(error) if isinstance(error, OSError) else error
    print(f"error: {shown_error(own)}", file=sys.stderr)
    return own.exit_code


@contextmanager
def guarded(where: str, *kinds: type[Exception], remedy: str = "") -> Iterator[None]:
    """Turn the exceptions of a library that decodes into an InputError; the block holds nothing but calls into that library.

    Args:
        where: the file and the place in it; begins the message.
        kinds: of exceptions to turn; by default all: a decoder may fail in any way on damaged bytes, and as the block holds
            no code of ours, no fault of ours is hidden.
        remedy: what to do; ends the message.

    Raises:
        InputError: the library failed; with `where`, the message of the library, and `remedy`.
    """
    turned = kinds or (Exception,)
    try:
        yield
    except ScenarioGenError:
        raise
    except turned as error:
        raise InputError(
            f"{where}: {describe(error)}" + (f"; {remedy}" if remedy else "")
        ) from error


@contextmanager
def reading(path: object) -> Iterator[None]:
    """Turn an unforeseen exception of a reader into an InputError that names the file; used once around each reader.

    Unlike in `guarded` there is code of ours in the block, so the error has a class of its own, a finding of the fuzzing.

    Raises:
        UnforeseenError: the reader failed with none of our errors, and none of the system's.
    """
    try:
        yield
    except (ScenarioGenError, OSError, MemoryError):
        raise
    except Exception as error:
        raise UnforeseenError(
            f"{path} cannot be read: {describe(error)}; it is damaged, or of a kind that is not known"
        ) from error


def describe(error: BaseException) -> str:
    """Return the message of an error in one line, with its class where the message is a single word or empty."""
    if isinstance(error, MemoryError):
        return "asks for more memory than there is"
    text = " ".join(str((isinstance(error, OSError) and error.strerror) or error).split())
    return text if len(text.split()) > 1 else f"{type(error).__name__} {text}".strip()
