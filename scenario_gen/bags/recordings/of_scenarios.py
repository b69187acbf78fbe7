# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The messages that are of one scenario: its own, one or several, and that of its ego's witness."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from msg_conventions.scenario_info import MESSAGES, ScenarioEntry
from msg_conventions.scenarios import decode_scenario, digest
from scenario_gen.bags.storage.bag import BagMessage
from scenario_gen.base.errors import InputError
from scenario_gen.types import Scenario


def decode_with_witness(
    data: bytes, entry: ScenarioEntry | None, k: int, witness: bytes | None, what: str, where: str
) -> tuple[int, Scenario]:
    """Return stamp [ns] and scenario, numbered as its entry says; without one, by its place.

    Args:
        data: of the scenario's messages.
        entry: its own on `scenarios/info`, if it has one.
        k: its place.
        witness: the message of its ego's witness, if it has one.
        what: names the scenario in messages.
        where: names the topic of the witness.

    Raises:
        InputError: a message is damaged, or the witness is not of another vehicle on the same road.
    """
    seed, index = (entry.seed, entry.index) if entry else (0, k)
    left_out = bool(entry and entry.ego)  # who is left out may have been the first
    stamp, scenario = decode_scenario(data, seed=seed, index=index, what=what, late=left_out)
    if entry and entry.facts:
        scenario = replace(scenario, facts=entry.facts)
    if witness is None:
        return stamp, scenario
    of, own = decode_scenario(witness, seed=seed, index=index, what=f"{where}, of scenario {index}", late=True)
    known = {vehicle.id for vehicle in scenario.vehicles}
    if (of, own.frame_id) != (stamp, scenario.frame_id) or len(own.vehicles) != 1 or own.vehicles[0].id in known:
        raise InputError(f"{where}, of scenario {index}: it is not one other vehicle with the scenario's stamp and frame")
    return stamp, replace(scenario, witness=own)


def joined_messages(messages: Sequence[BagMessage], entries: Iterable[ScenarioEntry]) -> Sequence[BagMessage]:
    """Return one message per scenario: who comes or goes is in messages of its own, which an entry names.

    Where one of them is missing, what is there stays as it is: its entry then has no scenario, and that is found.
    """
    several = [entry for entry in entries if MESSAGES in entry.status.values]
    if not several:
        return messages
    places: dict[str, list[int]] = {}
    for k, message in enumerate(messages):
        places.setdefault(digest(message.data), []).append(k)
    joined = dict(enumerate(messages))
    for entry in several:
        try:
            own = [places[sha256].pop(0) for sha256 in entry.messages if places.get(sha256)]
            whole = len(own) == len(entry.messages)
        except InputError:
            continue
        if not whole:
            continue
        data = b"".join(messages[k].data for k in own)
        for k in own:
            joined.pop(k)
        joined[own[0]] = replace(messages[own[0]], data=data)
    return [joined[k] for k in sorted(joined)]
