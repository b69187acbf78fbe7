# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ScenarioNet's scenario description (MetaDrive): pickled dictionaries, and two index files.

Source: metadrive.scenario.scenario_description of MetaDrive 0.4, whose `sanity_check` lists the
required keys.

We only write pickles and never read any, as reading one can run code. They contain Python's types
and arrays, encoded so that every version of NumPy can read them and the same scenario has the same
bytes.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
import io
import pickle
from typing import Any

import numpy as np

from scenario_gen.numerics import edge_lengths, unit
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.cases import Case, evenly_sampled, Exported
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.lights import light_of, states_at
from scenario_gen.types import (
    DRIVERS,
    height,
    Obstacle,
    OBSTACLE_HEIGHT_M,
    Scenario,
    SignalState,
    Vehicle,
)

VERSION = "MetaDrive v0.4.3"  # of the description, not of the simulator
DATASET = "scenario_gen"
_UNKNOWN = "TRAFFIC_LIGHT_UNKNOWN"
_STATES = {
    SignalState.GREEN: "TRAFFIC_LIGHT_GREEN",
    SignalState.YELLOW: "TRAFFIC_LIGHT_YELLOW",
    SignalState.RED: "TRAFFIC_LIGHT_RED",
    SignalState.RED_YELLOW: "TRAFFIC_LIGHT_RED",
}
SUMMARY_FILE = "dataset_summary.pkl"
MAPPING_FILE = "dataset_mapping.pkl"


def file_name(case: Case, exported: Exported) -> str:
    """Return the name of a scenario's file, as ScenarioNet forms it."""
    return f"sd_{DATASET}_1_case_{case.number}_{exported.index}.pkl"


def description(case: Case, exported: Exported, export: ExportConfig) -> dict[str, Any]:
    """Return ScenarioNet's description of a scenario: tracks, map, and self-driving car.

    The self-driving car is the ego, or else the first vehicle.

    Args:
        case: the case, with the lanes of its road.
        exported: the scenario.
        export: its `step` is the time step for a scenario with uneven steps.
    """
    motion = evenly_sampled(exported.everybody, export.step)
    tracks = {vehicle.id: _track(motion, n, vehicle) for n, vehicle in enumerate(motion.vehicles)}
    for k, obstacle in enumerate(case.lane_map.network.obstacles, 1):
        tracks[f"obstacle_{k}"] = _standing(obstacle, f"obstacle_{k}", len(motion.time))
    summaries = {name: _summary(name, track) for name, track in tracks.items()}
    ego = exported.ego.vehicles[0] if exported.ego is not None else motion.vehicles[0]
    name = f"case_{case.number}_{exported.index}"
    metadata: dict[str, Any] = {
        "id": name,
        "scenario_id": name,
        "dataset": DATASET,
        "metadrive_processed": False,
        "coordinate": "metadrive",
        "ts": motion.time.astype(np.float32),
        "track_length": len(motion.time),
        "sdc_id": ego.id,
        "map": case.road_name,
        "sha256": exported.sha256,
        "seed": exported.seed,
        "tracks_to_predict": {},
        "objects_of_interest": [],
        "object_summary": summaries,
        "number_summary": _counts(summaries),
    }
    lanes = range(len(case.lane_map.network.lanes))
    lights = _lights(case.lane_map, motion)
    if lights:
        metadata["number_summary"] |= {
            "num_traffic_lights": len(lights),
            "num_traffic_light_types": sorted(
                {state for light in lights.values() for state in light["state"]["object_state"]}
            ),
            "num_traffic_lights_each_step": dict.fromkeys(range(len(motion.time)), len(lights)),
        }
    return {
        "id": name,
        "version": VERSION,
        "length": len(motion.time),
        "metadata": metadata,
        "tracks": tracks,
        "dynamic_map_states": lights,
        "map_features": {str(k + 1): _map_feature(case.lane_map, k) for k in lanes},
    }


def _lights(lane_map: LaneMap, motion: Scenario) -> dict[str, dict[str, Any]]:
    """Return the states of the lights at each step, by the id of their lane in the file."""
    network, lights = lane_map.network, {}
    for rule in network.rules:
        for k in rule.lanes:
            light = light_of(rule, network, motion.facts.lights, (k,))
            if light is None:
                continue
            states = states_at(light.schedule, motion.time)
            centre = Curve.through(network.lanes[k].centre)
            at, _ = centre.project(light.line.mean(axis=0)[None])
            lane = str(k + 1)
            lights[lane] = {
                "type": "TRAFFIC_LIGHT",
                "state": {"object_state": [_STATES.get(state, _UNKNOWN) for state in states]},
                "lane": lane,
                "stop_point": np.array([*centre.at(at)[0, :2], 0.0], dtype=np.float32),
                "metadata": {
                    "type": "TRAFFIC_LIGHT",
                    "object_id": light.id,
                    "lane_id": lane,
                    "track_length": len(motion.time),
                    "dataset": DATASET,
                },
            }
    return lights


def _track(motion: Scenario, n: int, vehicle: Vehicle) -> dict[str, Any]:
    """Return the states of one vehicle; zeros while it is absent."""
    present = motion.is_present[n]
    steps = len(motion.time)

    def masked(values: Any) -> Any:
        mask = present if np.ndim(values) == 1 else present[:, None]
        return np.where(mask, values, 0.0).astype(np.float32)

    heading = motion.heading[n]
    state = {
        "position": masked(np.column_stack([motion.position[n], np.zeros(steps)])),
        "heading": masked(heading),
        "velocity": masked(motion.speed[n, :, None] * unit(heading)),
        "length": masked(np.full(steps, vehicle.length)),
        "width": masked(np.full(steps, vehicle.width)),
        "height": masked(np.full(steps, height(vehicle))),
        "valid": present.copy(),
    }
    return _as_track(vehicle.kind.scenarionet, vehicle.id, state)


def _standing(obstacle: Obstacle, name: str, steps: int) -> dict[str, Any]:
    """Return the states of an obstacle."""
    values = {
        "position": (obstacle.x, obstacle.y, 0.0),
        "heading": obstacle.yaw,
        "velocity": (0.0, 0.0),
        "length": obstacle.length,
        "width": obstacle.width,
        "height": OBSTACLE_HEIGHT_M,
    }
    state = {key: np.array([value] * steps, dtype=np.float32) for key, value in values.items()}
    state["valid"] = np.ones(steps, dtype=np.bool_)
    return _as_track("VEHICLE" if obstacle.is_car else "TRAFFIC_BARRIER", name, state)


def _as_track(kind: str, name: str, state: dict[str, Any]) -> dict[str, Any]:
    metadata = {
        "type": kind,
        "object_id": name,
        "track_length": len(state["valid"]),
        "dataset": DATASET,
    }
    return {"type": kind, "state": state, "metadata": metadata}


def _summary(name: str, track: Mapping[str, Any]) -> dict[str, Any]:
    """Return the summary of a track that ScenarioNet's filters use."""
    valid = track["state"]["valid"]
    positions = track["state"]["position"][valid, :2].astype(np.float64)
    distance = round(float(edge_lengths(positions).sum()), 3)
    return {
        "type": track["type"],
        "object_id": name,
        "track_length": len(valid),
        "moving_distance": distance,
        "distance": distance,
        "valid_length": int(valid.sum()),
        "continuous_valid_length": int(valid.sum()),
    }


def _counts(summaries: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers of objects and of moving objects, in all and by type."""
    moving = Counter(
        summary["type"]
        for summary in summaries.values()
        if summary["moving_distance"] > 1.0  # m
    )
    total = Counter(summary["type"] for summary in summaries.values())
    return {
        "num_moving_objects": moving.total(),
        "num_moving_objects_each_type": {kind: moving[kind] for kind in sorted(total)},
        "num_objects": len(summaries),
        "object_types": sorted(total),
        "num_objects_each_type": dict(sorted(total.items())),
        "num_traffic_lights": 0,
        "num_traffic_light_types": [],
        "num_traffic_lights_each_step": {},
    }


def _map_feature(lane_map: LaneMap, k: int) -> dict[str, Any]:
    """Return lane k as a feature of the map."""
    network = lane_map.network
    lane = network.lanes[k]
    polygon = lane.outline.astype(np.float32)
    if not lane.open_to(DRIVERS):
        return {"type": "CROSSWALK" if lane.crossing else "SIDEWALK", "polygon": polygon}
    is_bike_lane = bool(lane.users) and not lane.open_to(DRIVERS - {"bicycle"})
    adjacent = {
        side: [str(other + 1)]
        for side, (other, has_same_direction) in lane_map.neighbours(k).items()
        if has_same_direction
    }
    return {
        "type": "LANE_BIKE_LANE" if is_bike_lane else "LANE_SURFACE_STREET",
        "polyline": lane.centre.astype(np.float32),
        "polygon": polygon,
        "entry_lanes": [str(other + 1) for other in sorted(network.predecessors[k])],
        "exit_lanes": [str(other + 1) for other in sorted(lane.successors)],
        "left_neighbor": adjacent.get("left", []),
        "right_neighbor": adjacent.get("right", []),
    }


def dataset_files(described: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, bytes]:
    """Return the files that make a folder a data set: metadata and subfolder of each scenario.

    Args:
        described: file name and description of each scenario.
    """
    metadata = {name: content["metadata"] for name, content in described}
    return {
        SUMMARY_FILE: pickled(metadata),
        MAPPING_FILE: pickled(dict.fromkeys(metadata, "")),
    }


def pickled(value: Any) -> bytes:
    """Return a value as a pickle that every version of NumPy can read."""
    stream = io.BytesIO()
    pickler = _Pickler(stream, protocol=4)
    pickler.fast = True  # no memo: its references depend on which strings are the same object
    pickler.dump(value)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    """Pickles arrays as calls of `numpy.ndarray`.

    NumPy's default form names modules that differ between its versions.
    """

    def reducer_override(self, value: Any) -> Any:
        """Return the constructor call of an array; other values are pickled as usual."""
        if isinstance(value, np.ndarray):
            data = bytearray(np.ascontiguousarray(value).tobytes())
            return np.ndarray, (value.shape, value.dtype.str, data)
        return NotImplemented
