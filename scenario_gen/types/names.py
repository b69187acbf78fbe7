# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicle ids: as in the log, and as ROS names."""

from collections.abc import Iterable
import re

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.types.encounter import Encounter


def token(vehicle_id: str) -> str:
    """Return `vehicle_id` as a ROS name token: other characters become one underscore.

    Raises:
        InputError: nothing is left of the id.
    """
    escaped = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z_]", "_", vehicle_id)).strip("_")
    if not escaped:
        raise InputError(
            f"vehicle id {vehicle_id!r} holds no letter or digit, so no ROS name can be made of it"
        )
    return escaped


def tokens(vehicle_ids: Iterable[str]) -> tuple[str, ...]:
    """Return the tokens of several ids.

    Raises:
        InputError: two ids become the same token.
    """
    owner: dict[str, str] = {}
    for vehicle_id in vehicle_ids:
        other = owner.setdefault(token(vehicle_id), vehicle_id)
        if other != vehicle_id:
            raise InputError(
                f"vehicle ids {other!r} and {vehicle_id!r} are both {token(vehicle_id)!r} "
                "as ROS names; rename one"
            )
    return tuple(owner)


def vehicle_index(encounter: Encounter, name: str, what: str) -> int:
    """Return the index of the vehicle with the id `name`, written as in the log or as a ROS name.

    Raises:
        InputError: there is no such vehicle; the message names the parameter `what` and lists the
            ids that there are.
    """
    ids = [vehicle.id for vehicle in encounter.vehicles]
    for known in (ids, list(tokens(ids))):
        if name in known:
            return known.index(name)
    raise InputError(
        f"{what}: no vehicle {name!r} in {encounter.name}; "
        f"there are: {', '.join(ids)}{did_you_mean(name, ids)}"
    )
