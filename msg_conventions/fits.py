# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fit ⇄ `fit`: the changepoints on the road (conventions: trajectory.py).

Points are the anchors (start, changepoints, end) in the road's frame, at the template's times; the
first and last are the states requested of every scenario, speed included. Speeds in between are
the template's, scaled; no stage reads them. The decisions of the fitting are in the diagnostics, a
status for each vehicle. QoS: reliable, transient_local, depth 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import json
import math

import numpy as np

from msg_conventions import trajectory
from msg_conventions.diagnostics import Level, Status
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import BoundaryStates, Encounter, Fit, FittedVehicle, Loss, Route

CLOSE_ANCHORS_M = 1.0  # anchors that moved less need no warning


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


def decode_fit(data: bytes, source: str = "fit") -> tuple[int, str, BoundaryStates, Floats]:
    """Return stamp [ns], frame, the requested states, and the anchors (N, K + 2, 3) x, y, yaw.

    Raises:
        InputError: the message is damaged or has no start and end.
    """
    message = trajectory.decode(data, source)
    if len(message.time_ns) < 2:
        raise InputError(
            f"{source}: {len(message.time_ns)} point(s); a start and an end are needed"
        )
    state = np.concatenate(
        [message.position, message.heading[..., None], message.speed[..., None]], axis=-1
    )
    return (
        message.stamp_ns,
        message.frame_id,
        BoundaryStates(start=state[:, 0], end=state[:, -1]),
        state[..., :3],
    )


def fit_statuses(
    fit: Fit, node: str, more: Mapping[str, str] | None = None, routes: Sequence[Route] = ()
) -> tuple[Status, ...]:
    """Return the decisions of the fitting: a status per vehicle, and one with notes and losses.

    Args:
        fit: the fit.
        node: full name of the planner.
        more: values for each status.
        routes: the planned routes, whose figures and remarks are added.
    """
    common = dict(more or {})
    statuses = []
    notes = [str(note) for note in fit.notes]
    for k, (vehicle, fitted) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        remarks = routes[k].remarks(vehicle.id) if routes else ()
        figures = routes[k].figures() if routes else {}
        notes += map(str, remarks)
        largest = float(fitted.moved.max())
        is_close = largest < CLOSE_ANCHORS_M and not remarks
        statuses.append(
            Status(
                f"{node}: fit of {vehicle.id}",
                Level.OK if is_close else Level.WARN,
                f"{fitted.manoeuvre}, scale {fitted.scale:.3f}, moved by at most {largest:.2f} m",
                _fitted_values(fitted)
                | {key: json.dumps(value) for key, value in figures.items()}
                | common,
            )
        )
    values = {f"note.{k}": note for k, note in enumerate(notes)}
    for k, loss in enumerate(fit.losses):
        values[f"lost.{k}"] = json.dumps([loss.kind, list(loss.vehicles), loss.message])
    message = "recording fitted to the road"
    if fit.losses:
        message += f"; {len(fit.losses)} of its properties are not kept"
    level = Level.WARN if any(loss.kind != "arm" for loss in fit.losses) else Level.OK
    return (*statuses, Status(f"{node}: fit", level, message, values | common))


def _fitted_values(fitted: FittedVehicle) -> dict[str, str]:
    """Return the decisions of the fitting for a vehicle."""
    has_turn = np.isfinite(fitted.turned).all()
    return {
        "manoeuvre": fitted.manoeuvre,
        "scale": repr(fitted.scale),
        "moved_m": json.dumps(fitted.moved.tolist()),
        "stands": json.dumps([bool(value) for value in fitted.stands]),
        "turned_rad": json.dumps(list(fitted.turned) if has_turn else None),
    }


def decode_losses(values: Mapping[str, str]) -> tuple[Loss, ...]:
    """Return the losses in the planner's status `fit`.

    Raises:
        InputError: it is damaged.
    """
    losses = []
    for key, text in values.items():
        if key.startswith("lost."):
            with guarded(f"fit: {key} is damaged"):
                kind, vehicles, sentence = json.loads(text)
                losses.append(Loss(str(kind), tuple(map(str, vehicles)), str(sentence)))
    return tuple(losses)


def with_figures(route: Route, statuses: Mapping[str, Mapping[str, str]], vehicle: str) -> Route:
    """Return a decoded route with the figures in the planner's status `fit of <vehicle>`, if any.

    Raises:
        InputError: they are damaged.
    """
    values = statuses.get(f"fit of {vehicle}", {})
    if "legs_joined" not in values:
        return route
    with guarded(f"fit of {vehicle}: damaged"):
        joined, searched = (
            None if (n := json.loads(values[f"legs_{key}"])) is None else int(n)
            for key in ("joined", "searched")
        )
        left_out = tuple(int(k) for k in json.loads(values["anchors_left_out"]))
        far = json.loads(values["farthest_from_fit_m"])
    farthest = math.nan if far is None else float(far)
    return replace(route, joined=joined, searched=searched, left_out=left_out, farthest=farthest)


def decode_fitted(
    anchors: Floats, statuses: Mapping[str, Mapping[str, str]], vehicle: str
) -> FittedVehicle:
    """Return the decisions of the fitting for a vehicle.

    Args:
        anchors: (K + 2, 3) x, y, yaw, as `decode_fit` returns them.
        statuses: key-values of the planner's statuses by subject.
        vehicle: its id.

    Raises:
        InputError: it is not there, or damaged.
    """
    values = statuses.get(f"fit of {vehicle}", {})
    with guarded(f"fit of {vehicle}: damaged, or not there"):
        moved = np.array(json.loads(values["moved_m"]), dtype=np.float64)
        stands = np.array(json.loads(values["stands"]), dtype=np.bool_)
        scale, manoeuvre = float(values["scale"]), values["manoeuvre"]
        turn = json.loads(values.get("turned_rad", "null")) or (math.nan, math.nan)
        turned = (float(turn[0]), float(turn[1]))
    if (
        moved.shape != anchors.shape[:1]
        or stands.ndim != 1
        or not np.isfinite(moved).all()
        or not 0.0 < scale < math.inf
    ):
        raise InputError(f"fit of {vehicle}: damaged")
    return FittedVehicle(
        anchors=anchors,
        moved=moved,
        stands=stands,
        scale=scale,
        manoeuvre=manoeuvre,
        turned=turned,
    )
