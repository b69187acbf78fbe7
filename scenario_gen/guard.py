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

"""The boundary to a library that decodes files: what it raises on broken ones becomes an error that names the place."""

from collections.abc import Iterator
from contextlib import contextmanager

from scenario_gen.errors import InputError, ScenarioGenError


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


def said(error: Exception) -> str:
    """Return what an error says in one line, with its kind where it says little or nothing."""
    if isinstance(error, MemoryError):
        return "asks for more memory than there is"
    text = " ".join(str((isinstance(error, OSError) and error.strerror) or error).split())
    return text if len(text.split()) > 1 else f"{type(error).__name__} {text}".strip()
