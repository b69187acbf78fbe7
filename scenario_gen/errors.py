# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The errors that a person sees; each message names the place (file, row, topic, parameter) and what to do."""

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
    return InputError(f"{place}{error.strerror or error}{advice}")


def printable(text: str) -> str:
    """Return the text with what would steer a terminal (control characters, bidi marks) written as in Python source."""
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def tell(error: ScenarioGenError | OSError) -> int:
    """Say on standard error what is wrong; return the exit code."""
    own = of_system(error) if isinstance(error, OSError) else error
    print(f"error: {presentable(str(own))}", file=sys.stderr)
    return own.exit_code
