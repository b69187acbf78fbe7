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

"""Vehicle ids on the wire: ROS tokens, and the joint names that carry a footprint."""

from collections.abc import Iterable, Sequence
import re

from scenario_gen.encounter import Vehicle
from scenario_gen.errors import InputError

SMALLEST, LARGEST = 0.01, 1000.0  # metres of a footprint


def token(vehicle_id: str) -> str:
    """Return `vehicle_id` as a ROS name token: whatever is not a letter, digit or underscore becomes one underscore.

    Raises:
        InputError: nothing is left of the id.
    """
    escaped = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z_]", "_", vehicle_id)).strip("_")
    if not escaped:
        raise InputError(f"vehicle id {vehicle_id!r} holds no letter or digit, so no ROS name can be made of it")
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
            raise InputError(f"vehicle ids {other!r} and {vehicle_id!r} are both {token(vehicle_id)!r} as ROS names; rename one")
    return tuple(owner)


def joint_names(vehicles: Sequence[Vehicle]) -> tuple[str, ...]:
    """Return `<token>:<length>x<width>` of each vehicle, metres: the message needs no second one beside it."""
    names = tokens(vehicle.id for vehicle in vehicles)
    return tuple(f"{name}:{vehicle.length!r}x{vehicle.width!r}" for name, vehicle in zip(names, vehicles, strict=True))


def vehicle_of(joint_name: str) -> Vehicle:
    """Return the vehicle of a joint name; one without a footprint gets the default size of a car.

    Raises:
        InputError: the footprint is not two lengths of a vehicle.
    """
    name, colon, size = joint_name.partition(":")
    if not colon:
        return Vehicle(name)
    match = re.fullmatch(r"([0-9.eE+-]+)x([0-9.eE+-]+)", size)
    try:
        length, width = (float(value) for value in match.groups()) if match else (0.0, 0.0)
    except ValueError:
        length = width = 0.0
    if not (SMALLEST <= length <= LARGEST and SMALLEST <= width <= LARGEST):
        raise InputError(
            f"joint name {joint_name!r}: expected <id>:<length>x<width>, {SMALLEST:g} to {LARGEST:g} m each, e.g. car:4.8x1.9"
        )
    return Vehicle(name, length, width)
