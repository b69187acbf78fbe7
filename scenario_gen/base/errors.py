# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The errors of the project, what is shown of them, and how those of libraries become ours."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
import sys

LONGEST = 500  # characters of a message about an input: what is quoted from a broken file may be of any length


class ScenarioGenError(Exception):
    """Base of every error this project raises on purpose; the command line prints it without a traceback and exits with 2."""

    exit_code = 2


class InputError(ScenarioGenError):
    """A file, row, topic or parameter cannot be used as it is.

    The message is made fit to be shown, for it may quote the file: characters that do not print are escaped, and of a message
    that is too long the middle is left out, so that the place at its beginning and the remedy at its end stay.
    """

    def __init__(self, message: str) -> None:
        super().__init__(presentable(message))


class UnforeseenError(InputError):
    """A reader failed on a file in a way that nobody foresaw; the failure is its cause, and a fault to be mended."""


class MissingExtraError(ScenarioGenError, ImportError):
    """A library is not installed that only some uses need; the message names the extra that brings it."""


def needs(extra: str, *modules: str) -> None:
    """Refuse to go on where a module of an extra is not installed.

    Args:
        extra: a key of `extras_require` in setup.py.
        modules: top-level names; they are looked for, not imported.

    Raises:
        MissingExtraError: one is missing.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingExtraError(f"{', '.join(missing)} not installed; `pip install 'scenario_gen[{extra}]'` brings it")


def presentable(text: str) -> str:
    """Return a message with at most `LONGEST` characters, all of which print, or are line breaks."""
    if len(text) > LONGEST:  # at first roughly, for a quoted field may hold megabytes
        text = text[:LONGEST] + text[-LONGEST:]
    text = printable(text)
    half = LONGEST // 2
    return text if len(text) <= LONGEST else f"{text[: half - 3]} … {text[-half:]}"


class RefusedError(ScenarioGenError):
    """The input is sound but what was asked cannot be done with it, e.g. a template that fits no road."""


def of_system(error: OSError, name: object = None, advice: str = "") -> InputError:
    """Return an error of the operating system as one of ours: file (`name`, or the one it names itself), reason, advice."""
    file = error.filename if name is None else name
    place = "" if file is None else f"{file}: "
    reason = "is a folder; name a file" if isinstance(error, IsADirectoryError) else error.strerror or error
    return InputError(f"{place}{reason}{advice}")


def printable(text: str) -> str:
    """Return the text with what would steer a terminal (control characters, bidi marks) written as in Python source."""
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def tell(error: ScenarioGenError | OSError) -> int:
    """Say on standard error what is wrong; return the exit code."""
    own = of_system(error) if isinstance(error, OSError) else error
    print(f"error: {presentable(str(own))}", file=sys.stderr)
    return own.exit_code


@contextmanager
def guarded(where: str, *kinds: type[Exception], remedy: str = "") -> Iterator[None]:
    """Turn what a library raises while it decodes into an InputError; the block holds nothing but calls into that library.

    Args:
        where: the file and the place in it; begins the message.
        kinds: what to turn; everything by default, for a decoder that meets damaged bytes may fail in any way, and with
            none of our own code in the block no fault of ours can hide behind it.
        remedy: what to do; ends the message.

    Raises:
        InputError: the library failed; names `where`, what the library said, and `remedy`.
    """
    turned = kinds or (Exception,)
    try:
        yield
    except ScenarioGenError:
        raise
    except turned as error:
        raise InputError(f"{where}: {said(error)}" + (f"; {remedy}" if remedy else "")) from error


@contextmanager
def reading(path: object) -> Iterator[None]:
    """Turn whatever a reader did not foresee in a damaged file into an InputError that names the file; once around each reader.

    Unlike `guarded` there is code of ours in the block, so the error has a kind of its own, which the fuzzing takes as a finding.

    Raises:
        UnforeseenError: the reader failed with none of our errors, and none of the system's.
    """
    try:
        yield
    except (ScenarioGenError, OSError, MemoryError):
        raise
    except Exception as error:
        raise UnforeseenError(f"{path} cannot be read: {said(error)}; it is damaged, or of a kind that is not known") from error


def said(error: Exception) -> str:
    """Return what an error says in one line, with its kind where it says little or nothing."""
    if isinstance(error, MemoryError):
        return "asks for more memory than there is"
    text = " ".join(str((isinstance(error, OSError) and error.strerror) or error).split())
    return text if len(text.split()) > 1 else f"{type(error).__name__} {text}".strip()
