# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Callers whose answers arrive, on a busy machine too."""

from collections.abc import Callable
from typing import Any


def until_known_at(node: Any, other: str, wait: Callable[[Any], object]) -> None:
    """Wait until another node knows all readers that this one has made so far.

    Fast DDS gives up an answer 0.1 s after the request if it does not know the caller's reader of answers by then. Readers
    become known in the order in which they were made: once a later one gets an answer, so does any before it.

    Args:
        node: of the caller.
        other: the node that is going to be called; it has parameters.
        wait: waits for a future to be done, a second at most.
    """
    from rcl_interfaces.srv import GetParameters

    later = node.create_client(GetParameters, f"{other}/get_parameters")
    assert later.wait_for_service(180.0), other
    for _ in range(180):
        answer = later.call_async(GetParameters.Request())
        wait(answer)
        if answer.done():
            break
    assert answer.done(), f"no answer of {other}"
    node.destroy_client(later)
