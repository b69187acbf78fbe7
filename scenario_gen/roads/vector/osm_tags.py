# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tags of Lanelet2's elements, and the users that they allow."""

from collections.abc import Sequence

from scenario_gen.base.xml_reader import Element
from scenario_gen.types import DRIVERS, LANE_USERS

_USERS_BY_SUBTYPE = {
    "road": DRIVERS,
    "play_street": LANE_USERS,
    "exit": LANE_USERS,
    "highway": DRIVERS - {"bicycle"},
    "bus_lane": frozenset(("bus",)),
    "bicycle_lane": frozenset(("bicycle",)),
    "walkway": frozenset(("pedestrian",)),
    "shared_walkway": frozenset(("bicycle", "pedestrian")),
    "crosswalk": frozenset(("pedestrian",)),
    "stairs": frozenset(("pedestrian",)),
}


def tags_of(element: Element) -> dict[str, str]:
    """Return the tags of a node, a way or a relation."""
    return {tag.attribute("k"): tag.attribute("v") for tag in element.findall("tag")}


def value_of_first(tags: dict[str, str], keys: Sequence[str]) -> str | None:
    """Return the value of the first key that some tags have."""
    return next((tags[key] for key in keys if key in tags), None)


def users_of_tags(tags: dict[str, str]) -> frozenset[str]:
    """Return the users of a lanelet: its participants, or those of its subtype if it names none.

    If it names vehicles, but no bicycles, as in Autoware's maps, the subtype decides on these.
    """
    default = _USERS_BY_SUBTYPE.get(tags.get("subtype", "road"), frozenset())
    if not any(key.startswith("participant:") for key in tags):
        return default
    keys: dict[str, list[str]] = {}
    for user in DRIVERS:
        name = "car" if user == "van" else user
        keys[user] = [f"participant:vehicle:{name}", "participant:vehicle"]
    keys["bicycle"] = ["participant:bicycle"]
    if "bicycle" in default:
        keys["bicycle"].append("participant:vehicle")
    keys["pedestrian"] = ["participant:pedestrian"]
    allowed = ("yes", "true")
    return frozenset(
        user for user, names in keys.items() if value_of_first(tags, names) in allowed
    )
