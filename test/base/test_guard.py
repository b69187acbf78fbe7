# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Errors about inputs are fit to be shown, whatever the input quoted; the boundary to decoders lets no other error out."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

from scenario_gen.base.errors import (
    guarded,
    InputError,
    MAX_INPUT_CHARACTERS,
    print_error,
    RefusedError,
)


@given(st.text(), st.integers(0, 3000))
def test_a_message_is_short_and_prints(text, times):
    message = str(InputError(f"log.csv, line 3: {text * times}; name the column"))
    assert len(message) <= MAX_INPUT_CHARACTERS
    assert message.isprintable()
    assert message.startswith("log.csv, line 3: ") and message.endswith("; name the column")


def test_line_break_in_name_is_escaped(capsys):
    print_error(RefusedError("no road:", "vehicle 1\nerror: fake", "vehicle 2"))
    assert capsys.readouterr().err == "error: no road:\nvehicle 1\\nerror: fake\nvehicle 2\n"


def test_a_lone_surrogate_can_be_printed():
    str(InputError("column '\ud800'")).encode("utf-8")


@pytest.mark.parametrize(
    "error",
    [
        KeyError("t_s"),
        MemoryError("Unable to allocate 596 GiB"),
        ValueError("two\n words"),
        EOFError(),
    ],
)
def test_library_errors_name_the_place(error):
    with (
        pytest.raises(InputError, match=r"^log.db3, message 3: .*; record it again$") as caught,
        guarded("log.db3, message 3", remedy="record it again"),
    ):
        raise error
    assert caught.value.__cause__ is error
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("error", [InputError("no"), RefusedError("no"), KeyboardInterrupt()])
def test_errors_of_ours_and_interrupts_pass(error):
    with pytest.raises(type(error)) as caught, guarded("log.db3"):
        raise error
    assert caught.value is error
