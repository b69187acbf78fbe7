# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coordinate frames of a bag: which frames transforms tie to each other, and positions in them."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenario_gen.bags.vehicles import Samples
from scenario_gen.base.errors import InputError
from scenario_gen.logs.bag_names import BODY_FRAMES, child_vehicle
from scenario_gen.logs.config import POINTS
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Observations
from scenario_gen.numerics import Floats, Ints, wrap_angle

Complexes = NDArray[np.complex128]
_MAX_DEPTH_COUNT = 20  # transforms in a chain; more are a circle
_ODOMETRY_FRAME = "odom"
_NORTH_FIRST = "ned"  # x north, y east, z down


@dataclass
class Recording:
    """What one topic recorded of one vehicle.

    Attributes:
        vehicle: its name.
        topic: name of the topic.
        frame: of the positions, or "".
        child: frame whose pose it is, or "".
        observed: positions and speeds.
    """

    vehicle: str
    topic: str
    frame: str
    child: str
    observed: Observations

    @property
    def has_fixes(self) -> bool:
        """Whether it has positions."""
        return len(self.observed.fix_ns) > 0


def recordings_of(topic: str, samples: Iterable[Samples], first_row: int) -> list[Recording]:
    """Return what a topic recorded of each vehicle in each frame.

    Args:
        topic: its name.
        samples: its messages, with the stamps that count.
        first_row: row of the log of its first message.
    """
    groups: dict[tuple[str, str], list[Samples]] = {}
    for each in samples:
        groups.setdefault((child_vehicle(each.child), each.frame), []).append(each)
    return [
        Recording(name, topic, frame, parts[0].child, _observed(name, parts, first_row))
        for (name, frame), parts in groups.items()
    ]


def _observed(vehicle: str, parts: Sequence[Samples], first_row: int) -> Observations:
    """Return samples of one vehicle in one frame, in the order of the messages."""
    order = np.argsort(np.concatenate([part.row for part in parts]), kind="stable")

    def joined(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])[order]

    rows, stamps = first_row + joined("row"), joined("stamp_ns")
    n_fixes = 0 if parts[0].fix is None else len(rows)
    n_speeds = 0 if parts[0].speed is None else len(rows)
    return Observations(
        id=vehicle,
        fix_ns=stamps[:n_fixes],
        fix=joined("fix") if n_fixes else np.zeros((0, 2)),
        fix_row=rows[:n_fixes],
        heading=joined("heading")[:n_fixes],
        speed_ns=stamps[:n_speeds],
        speed=joined("speed") if n_speeds else np.zeros(0),
        speed_row=rows[:n_speeds],
        length=float(parts[0].size[0]),
        width=float(parts[0].size[1]),
        kind=parts[0].kind,
        height=joined("height")[:n_fixes],
        course=joined("course")[:n_speeds],
    )


def by_vehicle(recordings: Iterable[Recording]) -> dict[str, list[Recording]]:
    """Return the recordings of each vehicle."""
    vehicles: dict[str, list[Recording]] = {}
    for recording in recordings:
        vehicles.setdefault(recording.vehicle, []).append(recording)
    return vehicles


def bodies_of(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the vehicles among transforms: frames called as bodies, else those in a root."""
    bodies = [each for each in recordings if _last(each.child) in BODY_FRAMES]
    bodies = bodies or [each for each in recordings if each.child.endswith(BODY_FRAMES)]
    if bodies:
        return bodies
    children = {each.child.strip("/") for each in recordings}
    return [each for each in recordings if each.frame.strip("/") not in children]


def _last(frame: str) -> str:
    return frame.rpartition("/")[2]


@dataclass
class FrameTree:
    """Transforms from frames to their parents: (stamp [ns], x + iy [m], turn [rad]) of each."""

    transforms: dict[str, list[tuple[Ints, Complexes, Floats]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    parents: dict[str, str] = field(default_factory=dict)

    def add(self, parent: str, child: str, stamps: Ints, place: Complexes, turn: Floats) -> None:
        """Add transforms (F,); a second parent of a frame is ignored."""
        child, parent = child.strip("/"), parent.strip("/")
        if child != parent and self.parents.setdefault(child, parent) == parent:
            self.transforms[child].append((stamps, place, turn))

    def chain(self, frame: str) -> list[str]:
        """Return a frame and all above it; the last one is its root."""
        frames = [frame.strip("/")]
        while frames[-1] in self.parents and len(frames) < _MAX_DEPTH_COUNT:
            frames.append(self.parents[frames[-1]])
        return frames

    def root(self, frame: str) -> str:
        """Return the frame without a parent that a frame is tied to."""
        return self.chain(frame)[-1]

    def in_root(self, frame: str, observed: Observations) -> Observations:
        """Return positions in a frame as positions in its root, with x east and y north."""
        place, heading = _place(observed), observed.heading
        for child in self.chain(frame):
            points_north = child.endswith(_NORTH_FIRST)
            if points_north:
                place, heading = 1j * np.conj(place), 0.5 * np.pi - heading
            if child in self.parents:
                origin, turn = self._transforms_at(child, observed.fix_ns)
                turn = turn * (not points_north)
                place, heading = origin + np.exp(1j * turn) * place, heading + turn
        return _moved(observed, place, heading)

    def _transforms_at(self, child: str, stamps: Ints) -> tuple[Complexes, Floats]:
        """Return origin (F,) and turn (F,) of a frame in its parent at stamps (F,)."""
        known, place, turn = map(np.concatenate, zip(*self.transforms[child], strict=True))
        order = np.argsort(known, kind="stable")
        seconds = (known[order] - known[order[0]]) * 1e-9
        wanted = (stamps - known[order[0]]) * 1e-9
        origin = np.interp(wanted, seconds, place[order])
        return np.asarray(origin), np.interp(wanted, seconds, np.unwrap(turn[order]))

    def tie(
        self, parent: str, child: str, in_parent: Observations, in_child: Observations
    ) -> None:
        """Add the transforms that two recordings of one vehicle in two frames show."""
        of_child = FrameTree()
        of_child.add("frame", "body", in_child.fix_ns, _place(in_child), in_child.heading)
        stamps = in_parent.fix_ns
        common = (stamps >= in_child.fix_ns[0]) & (stamps <= in_child.fix_ns[-1])
        if common.any():
            body, body_heading = of_child._transforms_at("body", stamps[common])
            turn = wrap_angle(in_parent.heading[common] - body_heading)
            origin = _place(in_parent)[common] - np.exp(1j * turn) * body
            self.add(parent, child, stamps[common], origin, turn)


def _place(observed: Observations) -> Complexes:
    """Return positions (F,) [m] as x + iy."""
    return np.asarray(observed.fix[:, 0] + 1j * observed.fix[:, 1])


def _moved(observed: Observations, place: Complexes, heading: Floats) -> Observations:
    """Return a vehicle at other positions (F,) [m], x + iy, with other headings (F,)."""
    return replace(observed, fix=np.column_stack((place.real, place.imag)), heading=heading)


def in_one_frame(
    label: str, recordings: Sequence[Recording], tree: FrameTree
) -> tuple[list[Recording], list[str], list[Doubt]]:
    """Return one position of each vehicle, in the frame that transforms or other poses tie it to.

    Returns:
        The recordings, notes, and a doubt if nothing ties the frames of two vehicles.

    Raises:
        InputError: a frame moves with its vehicle.
    """
    used: list[Recording] = []
    notes: list[str] = []
    for group in by_vehicle(recordings).values():
        places = sorted((each for each in group if each.has_fixes), key=_density, reverse=True)
        used += [*(each for each in group if not each.has_fixes), *places[:1]]
        notes += [_tied(places[0], other, tree) for other in places[1:]]
    centres = {parent: child for child, parent in tree.parents.items() if "cent" in _last(child)}
    for recording in used:
        notes += _centred(recording, centres, tree)
        if recording.frame and recording.has_fixes:
            _move_to_root(label, recording, tree)
    return used, notes, _frame_doubts({r.vehicle: r.frame for r in used if r.has_fixes})


def _tied(best: Recording, other: Recording, tree: FrameTree) -> str:
    """Tie the frames of two recordings of one vehicle, if nothing does; return a note."""
    if best.frame and other.frame and tree.root(best.frame) != tree.root(other.frame):
        parent, child = tree.root(other.frame), tree.root(best.frame)
        in_parent = tree.in_root(other.frame, other.observed)
        tree.tie(parent, child, in_parent, tree.in_root(best.frame, best.observed))
        return f"vehicle {best.vehicle}: {other.topic} places {best.topic} in {other.frame!r}"
    return f"vehicle {best.vehicle} is read from {best.topic}, not {other.topic}"


def _centred(recording: Recording, centres: Mapping[str, str], tree: FrameTree) -> list[str]:
    """Move positions to the frame of the vehicle's centre, if it is known; return notes.

    Args:
        recording: of one vehicle.
        centres: the frames of centres, by their parents.
        tree: all transforms.
    """
    child = recording.child.strip("/")
    if child in centres:
        centre = tree.transforms[centres[child]][0][1][0]
        heading = recording.observed.heading
        place = _place(recording.observed) + np.exp(1j * heading) * centre
        recording.observed = replace(_moved(recording.observed, place, heading), ahead=0.0)
    elif "rear_axle" in child:
        recording.observed = replace(recording.observed, ahead=POINTS["rear_axle"])
        return [f"vehicle {recording.vehicle}: positions are those of its rear axle"]
    return []


def _move_to_root(label: str, recording: Recording, tree: FrameTree) -> None:
    """Move positions to the root of their frame.

    Raises:
        InputError: the root moves with its vehicle.
    """
    recording.observed = tree.in_root(recording.frame, recording.observed)
    recording.frame = tree.root(recording.frame)
    if _last(recording.frame).startswith("base_"):
        raise InputError(
            f"{label}, topic {recording.topic}: vehicle {recording.vehicle} is in frame "
            f"{recording.frame!r}, which moves with its vehicle; record it in a fixed "
            "frame, such as map"
        )


def _density(recording: Recording) -> int:
    return len(recording.observed.fix_ns)


def _frame_doubts(frames: Mapping[str, str]) -> list[Doubt]:
    """Return a doubt if vehicles have no common frame."""
    names = sorted(set(frames.values()))
    if len(frames) < 2 or (len(names) == 1 and _last(names[0]) != _ODOMETRY_FRAME):
        return []
    listed = ", ".join(f"{vehicle} in {frame!r}" for vehicle, frame in frames.items())
    cause = f"nothing ties the frames of the vehicles ({listed})"
    if len(names) == 1:
        cause = f"an odometry counts from where its vehicle started ({listed})"
    remedy = "record /tf and /tf_static too, or positions in one frame such as map"
    return [Doubt(Quantity.FRAME, float(len(names)), cause, remedy)]
