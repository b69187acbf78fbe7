# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fit and routes ⇄ `fit/info` (std_msgs/String, documents.py): all that the planner has decided.

It names the messages that it was made from; see `Plan`. For other programs the planner also
publishes each `vehicle_<id>/route` (paths.py) and `fit` (trajectory.py), the changepoints on the
road: points are the anchors (start, changepoints, end) in the road's frame, at the template's
times; the first and last are the states requested of every scenario, speed included. Speeds in
between are the template's, scaled. QoS: reliable, transient_local, depth 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from msg_conventions import trajectory
from msg_conventions.diagnostics import Level, Status
from msg_conventions.documents import decode_document, encode_document, hash_of, LANES, PLAN
from msg_conventions.paths import encode_route
from msg_conventions.topics import vehicle_topic
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Ints
from scenario_gen.types import (
    BoundaryStates,
    Encounter,
    Fit,
    FittedVehicle,
    Loss,
    Note,
    Route,
    Segmentation,
    tokens,
)

CLOSE_ANCHORS_M = 1.0  # anchors that moved less need no warning
INPUTS = ("tracks", "changepoints", "map", LANES)


@dataclass(frozen=True, eq=False)
class Plan:
    """A template on a road.

    Attributes:
        stamp: of the tracks [ns].
        frame_id: the road's.
        inputs: hashes of the messages that it was made from, by topic (documents.py).
        anchors: (K + 2,) samples of the tracks: start, changepoints, end.
        requested: states of the vehicles in the order of the tracks.
        fitted: decisions for each vehicle, without the fitted path.
        routes: of each vehicle.
        notes, losses: as in `Fit`.
    """

    stamp: int
    frame_id: str
    inputs: Mapping[str, str]
    anchors: Ints
    requested: BoundaryStates
    fitted: tuple[FittedVehicle, ...]
    routes: tuple[Route, ...]
    notes: tuple[Note, ...] = ()
    losses: tuple[Loss, ...] = ()

    def fit(self, encounter: Encounter) -> Fit:
        """Return the fit of the vehicles in the tracks.

        Raises:
            InputError: it is one of other vehicles or instants.
        """
        vehicles, count = encounter.vehicles, len(self.anchors)
        shapes = [vehicle.anchors.shape for vehicle in self.fitted]
        lengths = {len(self.requested.start), len(self.requested.end), len(self.routes)}
        if shapes != [(count, 3)] * len(vehicles) or lengths != {len(vehicles)}:
            raise InputError(
                f"{PLAN}: {len(shapes)} vehicles at {count} points; tracks have {len(vehicles)}"
            )
        if self.anchors[-1] != len(encounter.time) - 1:
            raise InputError(f"{PLAN}: it ends at sample {self.anchors[-1]}, not with the tracks")
        return Fit(vehicles, self.fitted, self.anchors, self.requested, self.notes, self.losses)


def encode_plan(
    encounter: Encounter,
    fit: Fit,
    routes: Sequence[Route],
    frame_id: str,
    messages: Mapping[str, bytes],
) -> bytes:
    """Return fit and routes as CDR bytes; `messages` has those that they were made from."""
    inputs = {topic: hash_of(topic, messages[topic]) for topic in INPUTS if topic in messages}
    fitted = tuple(replace(vehicle, path=np.zeros((0, 3))) for vehicle in fit.fitted)
    requested = BoundaryStates(fit.requested.start, fit.requested.end)
    return encode_document(
        Plan(
            encounter.start_ns,
            frame_id,
            inputs,
            fit.anchor_index,
            requested,
            fitted,
            tuple(routes),
            fit.notes,
            fit.losses,
        )
    )


def plan_messages(
    encounter: Encounter,
    segmentation: Segmentation,
    fit: Fit,
    routes: Sequence[Route],
    frame_id: str,
    messages: Mapping[str, bytes],
) -> dict[str, bytes]:
    """Return the planner's messages by topic: the fit, the routes, and `fit/info`.

    Args:
        encounter: the template.
        segmentation: of it.
        fit: of it.
        routes: of its vehicles.
        frame_id: the road's.
        messages: those that they were made from, by topic.
    """
    anchors = anchor_stamps(encounter, segmentation.changepoints)
    planned = {"fit": encode_fit(encounter, fit, frame_id)}
    for name, route in zip(tokens(encounter.ids), routes, strict=True):
        planned[vehicle_topic(name, "route")] = encode_route(route, anchors, frame_id)
    planned[PLAN] = encode_plan(encounter, fit, routes, frame_id, messages)
    return planned


def decode_plan(data: bytes, source: str = PLAN) -> Plan:
    """Return the plan.

    Raises:
        InputError: the message is damaged.
    """
    return decode_document(Plan, data, source)


def anchor_stamps(encounter: Encounter, changepoints: Ints) -> list[int]:
    """Return the K + 2 stamps [ns] of start, changepoints (K,) and end on the template's clock."""
    index = [0, *changepoints.tolist(), encounter.speed.shape[1] - 1]
    return [encounter.start_ns + k * encounter.dt_ns for k in index]


def encode_fit(encounter: Encounter, fit: Fit, frame_id: str) -> bytes:
    """Return the anchors as CDR bytes; `frame_id` is the road's."""
    poses = np.stack([vehicle.anchors for vehicle in fit.fitted])
    speed = encounter.speed[:, fit.anchor_index] * np.array(
        [[vehicle.scale] for vehicle in fit.fitted]
    )
    for k, state in ((0, fit.requested.start), (-1, fit.requested.end)):
        poses[:, k], speed[:, k] = state[:, :3], state[:, 3]
    time_ns, states = (
        fit.anchor_index * encounter.dt_ns,
        (poses[..., :2], poses[..., 2], speed, np.zeros_like(speed)),
    )
    return trajectory.encode(
        Trajectory(encounter.start_ns, frame_id, fit.vehicles, time_ns, *states)
    )


def fit_statuses(fit: Fit, node: str, routes: Sequence[Route] = ()) -> tuple[Status, ...]:
    """Return the fit for people: a status per vehicle, and one with notes and losses.

    Args:
        fit: the fit.
        node: full name of the planner.
        routes: the planned routes, whose remarks are added.
    """
    statuses = []
    notes = [str(note) for note in fit.notes]
    for k, (vehicle, fitted) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        remarks = routes[k].remarks(vehicle.id) if routes else ()
        notes += map(str, remarks)
        largest = float(fitted.moved.max())
        is_close = largest < CLOSE_ANCHORS_M and not remarks
        level = Level.OK if is_close else Level.WARN
        text = f"{fitted.manoeuvre}, scale {fitted.scale:.3f}, moved by at most {largest:.2f} m"
        statuses.append(Status(f"{node}: fit of {vehicle.id}", level, text))
    values = {f"note.{k}": note for k, note in enumerate(notes)}
    values |= {f"lost.{k}": loss.message for k, loss in enumerate(fit.losses)}
    message = "recording fitted to the road"
    if fit.losses:
        message += f"; {len(fit.losses)} of its properties are not kept"
    level = Level.WARN if any(loss.kind != "arm" for loss in fit.losses) else Level.OK
    return (*statuses, Status(f"{node}: fit", level, message, values))
