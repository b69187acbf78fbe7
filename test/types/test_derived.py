# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is derived from an object is computed once, and goes with it."""

import gc
import weakref

import pytest

from scenario_gen.base.errors import RefusedError
from scenario_gen.types import once_per_object


class Subject:
    """An object that can be referred to weakly."""


def test_it_is_computed_once_for_an_object_and_its_other_arguments():
    calls = []

    @once_per_object
    def derive(subject, number):
        calls.append((subject, number))
        return [number]

    first, second = Subject(), Subject()
    assert derive(first, 1) is derive(first, 1)
    assert derive(first, 2) == [2] and derive(second, 1) is not derive(first, 1)
    assert derive(second, number=3) == [3] and derive(second, number=4) == [4]
    assert calls == [(first, 1), (first, 2), (second, 1), (second, 3), (second, 4)]


def test_it_goes_with_the_object():
    @once_per_object
    def derive(_subject):
        return Subject()

    subject = Subject()
    derived = weakref.ref(derive(subject))
    assert derived() is not None
    del subject
    gc.collect()
    assert derived() is None


def test_a_refusal_is_not_kept():
    answers = iter([RefusedError("not yet"), 7])

    @once_per_object
    def derive(_subject):
        answer = next(answers)
        if isinstance(answer, RefusedError):
            raise answer
        return answer

    subject = Subject()
    with pytest.raises(RefusedError):
        derive(subject)
    assert derive(subject) == derive(subject) == 7
