# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""LaneNetwork ⇄ `road/lanes` (visualization_msgs/Marker): a road's lanes beside its grid.

A LINE_LIST has all borders as pairs of neighbouring points: lane after lane, the left border
before the right one; then the outlines of obstacles. `text` is a JSON object with these members:

- `name`, `notes`, `note_kinds`
- `lanes`, each with its `id`, the number of `points` of a border, `successors` and `beside`
  (indices of lanes), `speed_limit` [m/s, null: unknown], `junction`; also `users` if it is not for
  all vehicles, `crossing` true for crossings, `arm` (from 1) and `inward` for lanes of an arm of a
  built-in road, and `height` [m] of its points if lanes lie above others. Lanes closed to cars
  come last.
- `rules`, if the map has traffic rules, each with `id`, `kind`, `lanes`, `over` (indices of lanes)
  and `line` (points of the stop line), and `rules_kept`; also `schedule` of lights with states:
  `starts` [s] and `states` of its phases, `end` [s], and whether it `repeats`
- `origin`: latitude and longitude of the frame's origin, if the map has it
- `drawn` true for lanes of a built-in road, and `drawn_for` for those drawn for a template: the
  `frame` of the template (x, y [m], yaw [rad] on the road), and the ids of the `lanes` by which
  each vehicle arrives and leaves
- `obstacles`, if there are some: x, y [m], yaw [rad], length and width [m] of each

Action 2 (delete) means that the road has no lanes. Stamp and frame: the map's. QoS: reliable,
transient_local, depth 1.
"""

from collections.abc import Iterable, Iterator
import json
import math
from typing import Any

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import MARKER
from msg_conventions.markers import Action, Kind, Marker
from msg_conventions.trajectory import MAX_COORDINATE_M
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    DrawnFor,
    Lane,
    LaneNetwork,
    note_kinds,
    Obstacle,
    recorded_notes,
    RuleKind,
    SignalSchedule,
    TrafficRule,
)

TOPIC = "road/lanes"
TAIL_BYTES = 1  # after the last multiple of 4 in a message


def encode_lanes(network: LaneNetwork | None, frame_id: str, stamp_ns: int) -> bytes:
    """Return the lanes as CDR bytes, or a deletion for a road without lanes."""
    lanes = () if network is None else network.every_lane
    pairs = [
        border[np.repeat(np.arange(len(border)), 2)[1:-1]]
        for lane in lanes
        for border in (lane.left, lane.right)
    ]
    obstacles = () if network is None else network.obstacles
    pairs += [obstacle.outline[[0, 1, 1, 2, 2, 3, 3, 0]] for obstacle in obstacles]
    points = np.concatenate(pairs) if pairs else np.zeros((0, 2))
    text = "" if network is None else json.dumps(_document(network), ensure_ascii=False)
    marker = Marker(
        "lanes",
        Kind.LINE_LIST,
        Action.ADD if lanes else Action.DELETE,
        colour=(1.0, 1.0, 1.0, 0.7),
        points=points,
        text=text,
    )
    return encode(MARKER, **marker.fields(frame_id, stamp_ns))


def _document(network: LaneNetwork) -> dict[str, Any]:
    document: dict[str, Any] = {
        "name": network.name,
        "notes": list(map(str, network.notes)),
        "note_kinds": note_kinds(network.notes),
        "lanes": [_lane_document(lane, network.has_levels) for lane in network.every_lane],
    }
    if network.rules:
        document["rules"] = [
            {
                "id": rule.id,
                "kind": rule.kind,
                "lanes": rule.lanes,
                "over": rule.over,
                "line": rule.line.tolist(),
            }
            | ({} if rule.schedule is None else {"schedule": rule.schedule.document()})
            | ({"turns": list(rule.turns)} if rule.turns else {})
            for rule in network.rules
        ]
        document["rules_kept"] = network.rules_kept
    if network.drawn:
        document["drawn"] = True
    if network.obstacles:
        document["obstacles"] = network.obstacles
    if network.origin:
        document["origin"] = network.origin
    if network.drawn_for is not None:
        placed = network.drawn_for
        document["drawn_for"] = {"frame": placed.frame.tolist(), "lanes": placed.lanes}
    return document


def _lane_document(lane: Lane, has_levels: bool) -> dict[str, Any]:
    document = {
        "id": lane.id,
        "points": len(lane.left),
        "successors": lane.successors,
        "beside": lane.neighbours,
        "speed_limit": None if math.isnan(lane.speed_limit) else lane.speed_limit,
        "junction": lane.junction,
    }
    if lane.users:
        document["users"] = sorted(lane.users)
    if lane.crossing:
        document["crossing"] = True
    if lane.arm:
        document |= {"arm": lane.arm, "inward": lane.inward}
    if has_levels:
        document["height"] = [
            None if math.isnan(height) else round(height, 2) for height in lane.height.tolist()
        ]
    return document


def decode_lanes(data: bytes, source: str = TOPIC) -> tuple[str, LaneNetwork | None]:
    """Return the frame and the lanes, None if the road has none.

    Raises:
        InputError: the message is damaged, or its lanes contradict their borders.
    """
    marker = decode(MARKER, data, source, framed=True)
    frame_id, points = marker.frame_id, marker.points[:, :2]
    if marker.action == Action.DELETE:
        return frame_id, None
    if (marker.kind, marker.action) != (Kind.LINE_LIST, Action.ADD):
        raise InputError(
            f"{source}: a marker of type {marker.kind}, action {marker.action}; a line list (5) "
            "that is added (0) is needed"
        )
    if not (np.abs(points) <= MAX_COORDINATE_M).all():
        raise InputError(
            f"{source}: a border has a point that is not finite or more than {MAX_COORDINATE_M:g} "
            "m away"
        )
    try:
        document = json.loads(marker.text)
        obstacles = tuple(Obstacle(*map(float, each)) for each in document.get("obstacles", ()))
        if not np.isfinite(obstacles).all():
            raise ValueError("an obstacle is not finite")
        borders = points[: len(points) - 8 * len(obstacles)]
        lanes = tuple(_lanes(document["lanes"], borders, source))
        notes = recorded_notes(map(str, document["notes"]), str(document.get("note_kinds", "")))
        rules = tuple(map(_rule, document.get("rules", ())))
        network = LaneNetwork(
            str(document["name"]),
            lanes,
            notes,
            rules,
            rules_kept=document.get("rules_kept", True) is not False,
            drawn=document.get("drawn", False) is True,
            drawn_for=_drawn_for(document["drawn_for"]) if "drawn_for" in document else None,
            origin=tuple(map(float, document.get("origin", ()))),
            obstacles=obstacles,
        )
        return frame_id, network.with_lanes(lanes)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(
            f"{source}: its text does not describe lanes: {type(error).__name__}: {error}"
        ) from None


def _drawn_for(document: dict[str, Any]) -> DrawnFor:
    x, y, yaw = (float(value) for value in document["frame"])
    return DrawnFor(
        np.array([x, y, yaw]), tuple((str(first), str(last)) for first, last in document["lanes"])
    )


def _rule(document: dict[str, Any]) -> TrafficRule:
    lanes, over = _indices(document["lanes"]), _indices(document["over"])
    line = np.array([(float(x), float(y)) for x, y in document["line"]]).reshape(-1, 2)
    schedule = SignalSchedule.of_document(document["schedule"]) if "schedule" in document else None
    kind = RuleKind(document["kind"])
    turns = tuple(map(str, document.get("turns", ())))
    return TrafficRule(str(document["id"]), kind, lanes, over, line, schedule, turns)


def _lanes(documents: list[dict[str, Any]], points: Floats, source: str) -> Iterator[Lane]:
    """Yield the lanes of their documents, with borders from pairs of points (P, 2) [m]."""
    start = 0
    for document in documents:
        count = 2 * (int(document["points"]) - 1)
        if count < 2 or start + 2 * count > len(points):
            raise InputError(
                f"{source}: lane {document['id']!r} has borders of {document['points']} points, "
                f"and {len(points) - start} are left"
            )
        left, right = points[start : start + 2 * count].reshape(2, count, 2)
        limit = document["speed_limit"]
        yield Lane(
            str(document["id"]),
            np.concatenate((left[:1], left[1::2])),
            np.concatenate((right[:1], right[1::2])),
            successors=_indices(document["successors"]),
            neighbours=_indices(document["beside"]),
            speed_limit=math.nan if limit is None else float(limit),
            junction=str(document["junction"]),
            height=np.array(document.get("height", ()), dtype=np.float64),
            users=frozenset(map(str, document.get("users", ()))),
            crossing=document.get("crossing", False) is True,
            arm=int(document.get("arm", 0)),
            inward=document.get("inward", False) is True,
        )
        start += 2 * count
    if start != len(points):
        raise InputError(f"{source}: {len(points) - start} points belong to no lane")


def _indices(numbers: Iterable[Any]) -> tuple[int, ...]:
    return tuple(int(number) for number in numbers)
