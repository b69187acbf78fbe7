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

"""The QoS profiles that a bag says its publishers offered, as YAML of any version of rosbag2."""

from typing import Any

from scenario_gen.documents import parse_yaml
from scenario_gen.errors import InputError

TIMES = ("deadline", "lifespan", "liveliness_lease_duration")
NAMED = ("history", "reliability", "durability", "liveliness")


def profiles(text: str) -> list[dict[str, Any]]:
    """Return the profiles, none if the text is damaged: who reads a bag can do without them."""
    try:
        found = parse_yaml(text, "offered_qos_profiles") if text else []
    except InputError:
        return []
    return found if isinstance(found, list) and all(_is_whole(one) for one in found) else []


def _is_whole(profile: Any) -> bool:
    """Whether a profile has what every reader looks for."""
    return (
        isinstance(profile, dict)
        and isinstance(profile.get("depth"), int)
        and all(isinstance(profile.get(key), str | int) for key in NAMED)
        and all(isinstance(profile.get(key), dict) and {"sec", "nsec"} <= set(profile[key]) for key in TIMES)
        and isinstance(profile.get("avoid_ros_namespace_conventions"), bool)
    )


def is_reliable(profile: dict[str, Any]) -> bool:
    """Whether it is not best effort (2, as rosbag2 wrote before Jazzy)."""
    return str(profile["reliability"]).lower() not in ("best_effort", "2")


def is_transient_local(profile: dict[str, Any]) -> bool:
    """Whether what was published is kept for late joiners (1)."""
    return str(profile["durability"]).lower() in ("transient_local", "1")
