# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files that break a reader, as parameters of tests: those that are made, and those that were found, where they are."""

from fnmatch import fnmatch
from pathlib import Path

from fuzzing import broken
from fuzzing.harness import CRASHES
import pytest

from scenario_gen.base.errors import InputError, MAX_INPUT_CHARACTERS


def crash_files(*patterns: str) -> list:
    """Return one parameter of the fixture `file` for each file that is made, and for each that was found, marked `recorded`."""
    made = [
        Path(name) for name in broken.FILES if any(fnmatch(name, pattern) for pattern in patterns)
    ]
    found = sorted(
        file for pattern in patterns for file in CRASHES.glob(pattern) if file.is_file()
    )
    assert made, patterns
    return [
        *(pytest.param(file, id=f"made {file}") for file in made),
        *(pytest.param(file, id=file.name, marks=pytest.mark.recorded) for file in found),
    ]


def is_refused(read, *said: str) -> bool:
    """Whether reading ends in an error of ours, which names what it should; anything else that is raised goes on."""
    try:
        read()
    except InputError as error:
        assert 0 < len(str(error)) <= MAX_INPUT_CHARACTERS
        assert all(text in str(error) for text in said), str(error)
        return True
    return False
