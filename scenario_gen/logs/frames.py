# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coordinate frames of a bag: which frames transforms tie to each other, and positions in them."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import math

import numpy as np
from numpy.typing import NDArray

from scenario_gen.bags.vehicles import Sample, TrackedObject
from scenario_gen.base.errors import InputError
from scenario_gen.logs.bag_names import child_vehicle
from scenario_gen.logs.config import POINTS
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Fix, Rows, Speed
from scenario_gen.numerics import Floats, Ints, wrap_angle

Complexes = NDArray[np.complex128]
_MAX_DEPTH_COUNT = 20  # transforms in a chain; more are a circle
_BODIES = ("base_link", "base_footprint", "base", "body", "chassis")
_ODOMETRY_FRAME = "odom"
_NORTH_FIRST = "ned"  # x north, y east, z down


@dataclass
class Recording:
    """What one topic recorded of one vehicle.

    Attributes:
        vehicle: its name.
        topic: name of the topic.
        type: of its messages.
        frame: of the positions, or "".
        child: frame whose pose it is, or "".
        rows: positions and speeds.
        sizes: length and width [m] of tracked objects.
        kinds: labels of tracked objects.
        ahead: how far the centre is ahead of the positions, in vehicle lengths; NaN if unknown.
    """

    vehicle: str
    topic: str
    type: str
    frame: str
    child: str
    rows: Rows = field(default_factory=Rows)
    sizes: list[tuple[float, float]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)
    ahead: float = math.nan


@dataclass
class Recordings:
    """What one topic has recorded so far.

    Attributes:
        topic: its name.
        type: of its messages.
        by_vehicle_and_frame: the recordings.
        vehicles: by their child frames.
    """

    topic: str
    type: str
    by_vehicle_and_frame: dict[tuple[str, str], Recording] = field(default_factory=dict)
    vehicles: dict[str, str] = field(default_factory=dict)

    def add_objects(
        self, objects: Iterable[TrackedObject], frame: str, stamp_ns: int, row: int
    ) -> None:
        """Add the tracked objects of a message."""
        for tracked in objects:
            recording = self._recording_of(tracked.id, frame, "")
            state = (*tracked.position, tracked.heading, tracked.height)
            recording.rows.fixes.append(Fix(stamp_ns, row, *state))
            recording.rows.speeds.append(Speed(stamp_ns, row, tracked.speed))
            recording.sizes.append(tracked.size)
            recording.kinds[tracked.kind] += 1

    def add_sample(self, sample: Sample, stamp_ns: int, row: int) -> None:
        """Add position and speed of a vehicle, as far as the message has them."""
        if sample.child not in self.vehicles:
            self.vehicles[sample.child] = child_vehicle(sample.child)
        vehicle = self.vehicles[sample.child]
        rows = self._recording_of(vehicle, sample.frame, sample.child).rows
        if sample.position is not None:
            state = (*sample.position, sample.heading, sample.height)
            rows.fixes.append(Fix(stamp_ns, row, *state))
        if sample.speed is not None:
            rows.speeds.append(Speed(stamp_ns, row, sample.speed, sample.course))

    def rename_only(self, vehicle: str) -> None:
        """Name the vehicle if there is only one."""
        recordings = self.by_vehicle_and_frame.values()
        if len({recording.vehicle for recording in recordings}) == 1:
            for recording in recordings:
                recording.vehicle = vehicle

    def _recording_of(self, vehicle: str, frame: str, child: str) -> Recording:
        key = vehicle, frame
        if key not in self.by_vehicle_and_frame:
            made = Recording(vehicle, self.topic, self.type, frame, child)
            self.by_vehicle_and_frame[key] = made
        return self.by_vehicle_and_frame[key]


def by_vehicle(recordings: Iterable[Recording]) -> dict[str, list[Recording]]:
    """Return the recordings of each vehicle."""
    vehicles: dict[str, list[Recording]] = {}
    for recording in recordings:
        vehicles.setdefault(recording.vehicle, []).append(recording)
    return vehicles


def bodies_of(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the vehicles among transforms: frames called as bodies, else those in a root."""
    bodies = [each for each in recordings if _last(each.child) in _BODIES]
    bodies = bodies or [each for each in recordings if each.child.endswith(_BODIES)]
    if bodies:
        return bodies
    children = {each.child.strip("/") for each in recordings}
    return [each for each in recordings if each.frame.strip("/") not in children]


def _last(frame: str) -> str:
    return frame.rpartition("/")[2]


@dataclass
class FrameTree:
    """Transforms from frames to their parents: (stamp [ns], x [m], y [m], turn [rad]) of each."""

    transforms: dict[str, list[tuple[int, float, float, float]]] = field(
        default_factory=lambda: defaultdict(list)
    )
    parents: dict[str, str] = field(default_factory=dict)

    def add(self, parent: str, child: str, stamp_ns: int, x: float, y: float, turn: float) -> None:
        """Add a transform; a second parent of a frame is ignored."""
        child, parent = child.strip("/"), parent.strip("/")
        if child != parent and self.parents.setdefault(child, parent) == parent:
            self.transforms[child].append((stamp_ns, x, y, turn))

    def chain(self, frame: str) -> list[str]:
        """Return a frame and all above it; the last one is its root."""
        frames = [frame.strip("/")]
        while frames[-1] in self.parents and len(frames) < _MAX_DEPTH_COUNT:
            frames.append(self.parents[frames[-1]])
        return frames

    def root(self, frame: str) -> str:
        """Return the frame without a parent that a frame is tied to."""
        return self.chain(frame)[-1]

    def in_root(self, frame: str, fixes: Sequence[Fix]) -> list[Fix]:
        """Return fixes in a frame as fixes in its root, with x east and y north."""
        stamps = np.array([fix.stamp_ns for fix in fixes], dtype=np.int64)
        place, heading = _poses(fixes)
        for child in self.chain(frame):
            points_north = child.endswith(_NORTH_FIRST)
            if points_north:
                place, heading = 1j * np.conj(place), 0.5 * np.pi - heading
            if child in self.parents:
                origin, turn = self._transforms_at(child, stamps)
                turn = turn * (not points_north)
                place, heading = origin + np.exp(1j * turn) * place, heading + turn
        return _at_places(fixes, place, heading)

    def _transforms_at(self, child: str, stamps: Ints) -> tuple[Complexes, Floats]:
        """Return origin (F,) and turn (F,) of a frame in its parent at stamps (F,)."""
        known = sorted(self.transforms[child])
        seconds = np.array([entry[0] - known[0][0] for entry in known]) * 1e-9
        x, y, turn = np.array([entry[1:] for entry in known]).T
        wanted = (stamps - known[0][0]) * 1e-9
        origin = np.interp(wanted, seconds, x + 1j * y)
        return np.asarray(origin), np.interp(wanted, seconds, np.unwrap(turn))

    def tie(self, parent: str, child: str, in_parent: Rows, in_child: Rows) -> None:
        """Add the transforms that two recordings of one vehicle in two frames show."""
        of_child = FrameTree()
        for fix in in_child.fixes:
            of_child.add("frame", "body", fix.stamp_ns, fix.x, fix.y, fix.heading)
        first, last = in_child.fixes[0].stamp_ns, in_child.fixes[-1].stamp_ns
        common = [fix for fix in in_parent.fixes if first <= fix.stamp_ns <= last]
        if not common:
            return
        stamps = np.array([fix.stamp_ns for fix in common], dtype=np.int64)
        body, body_heading = of_child._transforms_at("body", stamps)
        place, heading = _poses(common)
        turn = wrap_angle(heading - body_heading)
        origin = place - np.exp(1j * turn) * body
        for fix, point, angle in zip(common, origin.tolist(), turn.tolist(), strict=True):
            self.add(parent, child, fix.stamp_ns, point.real, point.imag, angle)


def _poses(fixes: Sequence[Fix]) -> tuple[Complexes, Floats]:
    """Return places (F,) [m], x + iy, and headings (F,)."""
    place = np.array([complex(fix.x, fix.y) for fix in fixes], dtype=complex)
    return place, np.array([fix.heading for fix in fixes], dtype=float)


def _at_places(fixes: Sequence[Fix], place: Complexes, heading: Floats) -> list[Fix]:
    """Return the fixes at other places (F,) with other headings (F,)."""
    poses = zip(fixes, place.tolist(), heading.tolist(), strict=True)
    return [fix._replace(x=z.real, y=z.imag, heading=yaw) for fix, z, yaw in poses]


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
        places = sorted((each for each in group if each.rows.fixes), key=_density, reverse=True)
        used += [*(each for each in group if not each.rows.fixes), *places[:1]]
        notes += [_tied(places[0], other, tree) for other in places[1:]]
    centres = {parent: child for child, parent in tree.parents.items() if "cent" in _last(child)}
    for recording in used:
        notes += _centred(recording, centres, tree)
        if recording.frame and recording.rows.fixes:
            _move_to_root(label, recording, tree)
    return used, notes, _frame_doubts({r.vehicle: r.frame for r in used if r.rows.fixes})


def _tied(best: Recording, other: Recording, tree: FrameTree) -> str:
    """Tie the frames of two recordings of one vehicle, if nothing does; return a note."""
    if best.frame and other.frame and tree.root(best.frame) != tree.root(other.frame):
        parent, child = tree.root(other.frame), tree.root(best.frame)
        tree.tie(parent, child, _rooted(other, tree), _rooted(best, tree))
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
        ahead, left = tree.transforms[centres[child]][0][1:3]
        place, heading = _poses(recording.rows.fixes)
        place = place + np.exp(1j * heading) * complex(ahead, left)
        recording.rows.fixes = _at_places(recording.rows.fixes, place, heading)
        recording.ahead = 0.0
    elif "rear_axle" in child:
        recording.ahead = POINTS["rear_axle"]
        return [f"vehicle {recording.vehicle}: positions are those of its rear axle"]
    return []


def _move_to_root(label: str, recording: Recording, tree: FrameTree) -> None:
    """Move positions to the root of their frame.

    Raises:
        InputError: the root moves with its vehicle.
    """
    recording.rows = _rooted(recording, tree)
    recording.frame = tree.root(recording.frame)
    if _last(recording.frame).startswith("base_"):
        raise InputError(
            f"{label}, topic {recording.topic}: vehicle {recording.vehicle} is in frame "
            f"{recording.frame!r}, which moves with its vehicle; record it in a fixed "
            "frame, such as map"
        )


def _density(recording: Recording) -> int:
    return len(recording.rows.fixes)


def _rooted(recording: Recording, tree: FrameTree) -> Rows:
    return Rows(tree.in_root(recording.frame, recording.rows.fixes), recording.rows.speeds)


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
    return [Doubt("", 0.0, 0.0, Quantity.FRAME, float(len(names)), "", cause, remedy)]
