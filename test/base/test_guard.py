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
    MAX_REFUSAL_CHARACTERS,
    print_error,
    RefusedError,
)


@given(st.text(), st.integers(0, 3000))
def test_a_message_is_short_and_prints(text, times):
    message = str(InputError(f"log.csv, line 3: {text * times}; name the column"))
    assert len(message) <= MAX_INPUT_CHARACTERS
    assert message.isprintable()
    assert message.startswith("log.csv, line 3: ") and message.endswith("; name the column")


def test_a_line_break_in_a_name_is_no_line_of_an_error(capsys):
    print_error(RefusedError("no road:", "vehicle 1\nerror: fake", "vehicle 2"))
    assert capsys.readouterr().err == "error: no road:\nvehicle 1\\nerror: fake\nvehicle 2\n"


def test_of_joined_refusals_each_keeps_its_reason_and_remedy(capsys):
    refusals = [
        f"road {name}: vehicle 1 {'drives on and on ' * 90}; choose road merge"
        for name in ("straight", "curve")
    ]
    print_error(RefusedError("; ".join(refusals)))
    said = capsys.readouterr().err
    assert said.count("choose road merge") == 2 and "road curve: vehicle 1 drives on" in said
    assert len(said) <= len("error: \n") + MAX_REFUSAL_CHARACTERS
    assert set(said.split()) <= {"error:", "…", *"; ".join(refusals).split()}, "no word is cut"
    print_error(
        RefusedError(
            "nothing could be generated:", *["road merge: " + "its arms differ " * 60] * 9
        )
    )
    assert "…" not in capsys.readouterr().err, "each refusal has a line of its own"


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
def test_what_a_library_raises_becomes_an_error_of_the_place(error):
    with (
        pytest.raises(InputError, match=r"^log.db3, message 3: .*; record it again$") as caught,
        guarded("log.db3, message 3", remedy="record it again"),
    ):
        raise error
    assert caught.value.__cause__ is error
    assert "\n" not in str(caught.value)


def test_only_the_kinds_that_are_named_are_turned():
    with pytest.raises(KeyError), guarded("log.db3", ValueError, OSError):
        raise KeyError("t_s")


@pytest.mark.parametrize("error", [InputError("no"), RefusedError("no"), KeyboardInterrupt()])
def test_errors_of_ours_and_interrupts_pass(error):
    with pytest.raises(type(error)) as caught, guarded("log.db3"):
        raise error
    assert caught.value is error
