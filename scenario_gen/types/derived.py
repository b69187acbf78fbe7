# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is computed once from an object (an encounter, a road, a network of lanes) and kept as long as the object lives."""

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Subject = TypeVar("Subject")
Others = ParamSpec("Others")
Derived = TypeVar("Derived")


def once_per_object(
    function: Callable[Concatenate[Subject, Others], Derived],
) -> Callable[Concatenate[Subject, Others], Derived]:
    """Keep what a function derives from its first argument, by its others; a refusal is not kept.

    What it returns must not refer to that argument: both would stay for good.
    """
    kept: WeakKeyDictionary[Subject, dict[tuple[object, ...], Derived]] = WeakKeyDictionary()

    @wraps(function)
    def derived(subject: Subject, /, *args: Others.args, **kwargs: Others.kwargs) -> Derived:
        known, key = kept.setdefault(subject, {}), (*args, *sorted(kwargs.items()))
        if key not in known:
            known.setdefault(key, function(subject, *args, **kwargs))
        return known[key]

    return derived
