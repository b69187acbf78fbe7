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

LONGEST = 500
"""Characters of a message on the terminal."""


class ScenarioGenError(Exception):
    """Base of every error this project raises on purpose; the command line prints it without a traceback and exits with 2."""

    exit_code = 2


class InputError(ScenarioGenError):
    """A file, row, topic or parameter cannot be used as it is."""


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


def shown(error: object) -> str:
    """Return the message of an error as a terminal gets it: printable, its middle left out where it is too long."""
    text = printable(str(error))
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 201]}…{text[-200:]}"
