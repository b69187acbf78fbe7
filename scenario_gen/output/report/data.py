# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compact data of the report: trajectories as 16-bit integers, matrices as bytes."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import shapely

from scenario_gen.method.evaluation import common_motion, mean_feature
from scenario_gen.numerics import Floats, runs
from scenario_gen.roads import to_metres
from scenario_gen.types import (
    DRIVERS,
    Encounter,
    Fit,
    GenerationResult,
    Road,
    Route,
    Scenario,
    Segmentation,
)
from scenario_gen.types.markings import markings

FRAME_PERIOD_S = 0.2
"""Period of the stored frames; the page interpolates between them."""
MAX_FRAMES_COUNT = 240
SEAM_M = 0.02
"""Half of a seam between lanes that is closed."""
MATRIX_SIZE_CELLS = 72
MAX_LINES = 400
MAX_STATES_COUNT = 500_000
"""States of all drawn scenarios of a set, for pages of a few megabytes."""
MAX_COMPARED_COUNT = 50
"""Scenarios that a matrix shows."""


def case_data(case: GenerationResult, samples: int) -> dict[str, Any]:
    """Return the drawings of one case for JSON, with at most `samples` scenarios."""
    encounter = case.encounter.with_trailers()
    ids = encounter.ids
    arms = _arms(case, samples)
    longest = max(
        [case.encounter.duration, *(float(s.time[-1]) for group in arms.values() for s in group)]
    )
    frames = min(MAX_FRAMES_COUNT, int(np.ceil(longest / FRAME_PERIOD_S)) + 1)
    frames = max(2, min(frames, MAX_STATES_COUNT // (len(arms["with"] or ids) * len(ids))))
    return {
        "row": case.row_name,
        "vehicles": [
            {"id": v.id, "type": v.type, "length": _short(v.length), "width": _short(v.width)}
            for v in encounter.vehicles
        ],
        "left_out": [
            n
            for n, owner in enumerate(encounter.owners)
            if ids[owner] not in case.evaluation.vehicles
        ],
        "road": road_data(case.road) if case.road else None,
        "made": encounter.made,
        "template": _template(encounter, case.segmentation, frames),
        "fit": _fit(case.fit, case.routes) if case.fit else [],
        "reactions": _reactions(case),
        "arms": {name: _trajectories(group, frames, ids) for name, group in arms.items() if group},
        "turn": _turn(case.encounter, case.fit),
        "coverage": None if case.coverage is None else case.coverage.document(),
        "features": _features(case.encounter, arms, case.evaluation.vehicles),
    }


def _arms(case: GenerationResult, samples: int) -> dict[str, tuple[Scenario, ...]]:
    """Return the drawn scenarios and the replay; picks of the coverage are always drawn."""
    first = case.generated.scenarios[:samples]
    arms = {"with": tuple(scenario.with_trailers() for scenario in first)}
    if case.coverage is not None:
        shown = {scenario.index for scenario in arms["with"]}
        picks = set(case.coverage.picks.values()) - shown
        rest = case.generated.scenarios[samples:] if picks else ()
        arms["with"] += tuple(each.with_trailers() for each in rest if each.index in picks)
    if case.replay is not None:
        arms["replay"] = (case.replay.with_trailers(),)
    return arms


def pack(values: Floats) -> dict[str, Any]:
    """Pack an array (..., K) of any unit as 16-bit integers, with offset and step per column."""
    flat = values.reshape(-1, values.shape[-1])
    low, high = flat.min(axis=0), flat.max(axis=0)
    step = np.maximum((high - low) / 65535.0, 1e-9)
    whole = np.round((flat - low) / step).astype("<u2")
    return {
        "shape": list(values.shape),
        "low": [_short(value, 9) for value in low],
        "step": [float(f"{value:.9g}") for value in step],
        "data": b64encode(whole.tobytes()).decode("ascii"),
    }


def _short(value: float, digits: int = 3) -> float:
    return round(float(value), digits)


def road_data(road: Road) -> dict[str, Any]:
    """Return the name of a road, the rings of its area, and its markings; x, y, x, y, … [m].

    The area has the borders of lanes, and elsewhere the edges of drivable cells without their
    steps. Lanes for some types only, as cycle lanes, count as drivable.
    """
    cells = [
        (first, row, stop, row + 1)
        for row, flags in enumerate(road.cleared.drivable)
        for first, stop in runs(flags)
    ]
    steps = shapely.union_all(shapely.box(*np.transpose(cells)))
    # The simplified edge may lie a cell and a quarter from that of the cells.
    ground = shapely.transform(steps.simplify(1.25), partial(to_metres, road))
    lanes = road.lanes.every_lane if road.lanes is not None else ()
    shapes = [shapely.Polygon(lane.outline) for lane in lanes if lane.open_to(DRIVERS)]
    area = shapely.union_all([ground, *shapely.buffer(shapes, SEAM_M)]).simplify(SEAM_M)
    polygons = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    rings = [ring for part in polygons for ring in (part.exterior, *part.interiors)]
    return {
        "name": road.name,
        "rings": [np.asarray(ring.coords).ravel().round(2).tolist() for ring in rings],
        "markings": _markings(road),
    }


def _markings(road: Road) -> dict[str, list[list[float]]]:
    """Return road markings by kind, each as x, y, x, y, … [m]; a subset on large maps."""
    if road.lanes is None:
        return {}
    drawn = {}
    for kind, lines in markings(road.lanes).items():
        shown = lines[:: max(1, -(-len(lines) // MAX_LINES))]
        drawn[kind.value] = [_few_points(line).ravel().round(2).tolist() for line in shown]
    return drawn


def _few_points(line: Floats, most: int = 25) -> Floats:
    """Return at most some of the points of a line (M, 2), spread evenly."""
    rows = np.linspace(0, len(line) - 1, min(len(line), most)).round().astype(np.int64)
    return line[rows]


def _turn(encounter: Encounter, fit: Fit | None) -> float:
    """Return the angle [rad] from the recording to the road: the mean over first headings."""
    if fit is None or not fit.fitted:
        return 0.0
    first = [fitted.anchors[0, 2] for fitted in fit.fitted]
    turned = np.array(first) - encounter.heading[:, 0]
    return _short(float(np.arctan2(np.sin(turned).sum(), np.cos(turned).sum())))


def states(source: Encounter | Scenario, frames: int) -> Floats:
    """Return (N, frames, 4) x, y [m], yaw [rad], speed [m/s] at evenly spaced instants."""
    at = source.at(np.linspace(0.0, source.time[-1], frames))
    return np.concatenate([at.poses, at.speed[..., None]], axis=-1)


def _trajectories(
    scenarios: Sequence[Scenario], frames: int, ids: Sequence[str]
) -> dict[str, Any]:
    return {
        "states": pack(np.stack([_whole(scenario, frames, ids) for scenario in scenarios])),
        "there": [_presence(scenario, ids) for scenario in scenarios],
        "durations": [_short(scenario.time[-1]) for scenario in scenarios],
        "index": [scenario.index for scenario in scenarios],
        "outcome": ["; ".join(map(str, each.facts.passing_order)) for each in scenarios],
    } | lights_of_all(scenarios)


def lights_of_all(scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Return the traffic lights of each scenario; nothing if no states are known."""
    lights = [[light.document() for light in each.facts.lights] for each in scenarios]
    return {"lights": lights} if any(lights) else {}


def _presence(source: Encounter | Scenario, ids: Sequence[str]) -> list[list[float]]:
    """Return the first and last instant of each vehicle, as shares of the duration.

    A vehicle that is left out counts as present throughout.
    """
    shares = (source.time[source.present] / source.time[-1]).round(5).tolist()
    present = dict(zip(source.ids, shares, strict=True))
    return [present.get(name, [0.0, 1.0]) for name in ids]


def _whole(scenario: Scenario, frames: int, ids: Sequence[str]) -> Floats:
    """Return the states of all vehicles; a left-out vehicle has those of the reference drive.

    Without a reference drive, it is drawn under the first vehicle.
    """
    known = dict(zip(scenario.ids, states(scenario, frames), strict=True))
    missing = next(iter(known.values()))
    if scenario.reference_drive is not None:
        left_out = scenario.reference_drive.with_trailers()
        known |= zip(left_out.ids, states(left_out, frames), strict=True)
    return np.stack([known.get(name, missing) for name in ids])


def _template(encounter: Encounter, segmentation: Segmentation, frames: int) -> dict[str, Any]:
    bounds = [0, *segmentation.changepoints.tolist(), len(encounter.time) - 1]
    step = max(1, -(-len(encounter.time) // 600))
    probability = segmentation.changepoint_probability
    padded = np.append(probability, np.zeros(-len(probability) % step)).reshape(-1, step)
    return {
        "states": pack(states(encounter, frames)[None]),
        "there": [_presence(encounter, encounter.ids)],
        "durations": [_short(encounter.duration)],
        "bounds": [_short(encounter.time[i]) for i in bounds],
        "labels": [int(segmentation.labels[i]) for i in bounds[:-1]],
        "descriptions": list(segmentation.descriptions),
        "probability": [_short(value) for value in padded.max(axis=1)],
        "probability_step": _short(step * encounter.dt, 6),
    }


def _fit(fit: Fit, routes: Sequence[Route]) -> list[dict[str, Any]]:
    vehicles = []
    for fitted, route in zip(fit.fitted, routes, strict=True):
        vehicles.append(
            {
                "route": _few_points(route.points[:, :2], 200).round(2).tolist(),
                "anchors": [
                    [_short(x, 2), _short(y, 2), _short(yaw)] for x, y, yaw in fitted.anchors
                ],
            }
        )
    return vehicles


def _reactions(case: GenerationResult) -> list[dict[str, Any]]:
    """Return the reactions between vehicles, with their interval as shares of the recording."""
    duration = case.encounter.duration
    graph = case.generated.graph
    return [
        {
            "who": edge.who,
            "whom": edge.whom,
            "kind": edge.kind,
            "from": _short(edge.since / duration),
            "to": _short(edge.until / duration),
        }
        for edge in (graph.edges if graph is not None else ())
    ]


def _features(
    encounter: Encounter, arms: Mapping[str, Sequence[Scenario]], shared: Sequence[str]
) -> list[dict[str, Any]]:
    """Return the paper's figure 5 for pairs of `shared` vehicles: bytes, 255 = 1."""
    groups: dict[str, Sequence[Encounter | Scenario]] = {"template": [encounter], **arms}
    pairs = []
    rows = [n for n, vehicle in enumerate(encounter.vehicles) if vehicle.id in shared]
    for pair in list(combinations(rows, 2))[:10]:
        names = encounter.vehicles[pair[0]].id, encounter.vehicles[pair[1]].id
        entry: dict[str, Any] = {"pair": list(pair), "position": {}, "speed": {}}
        for name, group in groups.items():
            matrices = _matrices(group, names)
            if matrices is not None:
                entry["position"][name], entry["speed"][name] = matrices
        pairs.append(entry)
    return pairs


def _matrices(
    group: Sequence[Encounter | Scenario], names: tuple[str, str]
) -> tuple[str, str] | None:
    """Return the mean matrices of positions and speeds of a pair; None without common motion."""
    common = [
        common_motion(source, names, MATRIX_SIZE_CELLS) for source in group[:MAX_COMPARED_COUNT]
    ]
    motions = [motion for motion in common if motion is not None]
    if not motions:
        return None
    first, second = (
        np.ascontiguousarray(np.stack([motion.position[k].T for motion in motions]))
        for k in (0, 1)
    )
    speeds = [np.stack([motion.speed[k][None] for motion in motions]) for k in (0, 1)]
    position_matrix = _bytes(mean_feature(first, second, "euclidean"))
    return position_matrix, _bytes(mean_feature(speeds[0], speeds[1], "manhattan"))


def _bytes(matrix: Floats) -> str:
    return b64encode(np.round(255.0 * matrix).astype(np.uint8).tobytes()).decode("ascii")
