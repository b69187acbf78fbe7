# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ScenarioNet's description of a scenario (MetaDrive): pickled dictionaries, and the two files that make a folder a data set.

Source: metadrive.scenario.scenario_description of MetaDrive 0.4, whose `sanity_check` says what is needed.

Pickles are written, never read: a pickle runs what it holds. They hold nothing but Python's own types and arrays, which are
written so that every version of NumPy reads them and the same scenario has the same bytes.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
import io
import pickle
from typing import Any

import numpy as np

from scenario_gen.numerics.plane import edge_lengths, unit
from scenario_gen.output.exchange.cases import Case, Exported
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.motion import even_step
from scenario_gen.types import DRIVERS, height, Scenario, Vehicle

VERSION = "MetaDrive v0.4.3"  # the description's, not the simulator's
DATASET = "scenario_gen"
MIN_MOVING_DISTANCE_M = 1.0  # of an object that counts as moving
SUMMARY, MAPPING = "dataset_summary.pkl", "dataset_mapping.pkl"


def file_name(case: Case, exported: Exported) -> str:
    """Return the name of a scenario's file, as ScenarioNet forms it."""
    return f"sd_{DATASET}_1_case_{case.number}_{exported.index}.pkl"


def description(case: Case, exported: Exported, export: ExportConfig) -> dict[str, Any]:
    """Return a scenario as ScenarioNet describes it: tracks, lanes, the self-driving car (the ego, else the first vehicle).

    Args:
        case: with the lanes of its road.
        exported: the scenario.
        export: `step` is the time step where the scenario has uneven ones.
    """
    motion = exported.everybody
    if even_step(motion) is None:
        motion = motion.resampled(export.step)
    tracks = {vehicle.id: _track(motion, n, vehicle) for n, vehicle in enumerate(motion.vehicles)}
    ego = exported.ego.vehicles[0].id if exported.ego is not None else motion.vehicles[0].id
    steps = len(motion.time)
    name = f"case_{case.number}_{exported.index}"
    metadata = {
        "id": name, "scenario_id": name, "dataset": DATASET, "metadrive_processed": False, "coordinate": "metadrive",
        "ts": motion.time.astype(np.float32), "track_length": steps, "sdc_id": ego, "map": case.road_name,
        "sha256": exported.sha256, "seed": exported.seed, "tracks_to_predict": {}, "objects_of_interest": [],
        "object_summary": {vehicle.id: _summary(tracks[vehicle.id], vehicle.id) for vehicle in motion.vehicles},
        "number_summary": _numbers(tracks),
    }  # fmt: skip
    lanes = {str(k + 1): _lane(case.lane_map, k) for k in range(len(case.lane_map.network.lanes))}
    return {
        "id": name,
        "version": VERSION,
        "length": steps,
        "metadata": metadata,
        "tracks": tracks,
        "dynamic_map_states": {},
        "map_features": lanes,
    }


def _track(motion: Scenario, n: int, vehicle: Vehicle) -> dict[str, Any]:
    """Return the states of one vehicle; zeros while it is absent."""
    present = motion.is_present[n]
    steps = len(motion.time)

    def masked(values: Any) -> Any:
        mask = present if np.ndim(values) == 1 else present[:, None]
        return np.where(mask, values, 0.0).astype(np.float32)

    heading, speed = motion.heading[n], motion.speed[n]
    velocity = speed[:, None] * unit(heading)
    state = {
        "position": masked(np.column_stack([motion.position[n], np.zeros(steps)])),
        "heading": masked(heading),
        "velocity": masked(velocity),
        "length": masked(np.full(steps, vehicle.length)),
        "width": masked(np.full(steps, vehicle.width)),
        "height": masked(np.full(steps, height(vehicle))),
        "valid": present.copy(),
    }
    kind = vehicle.kind.scenarionet
    metadata = {"type": kind, "object_id": vehicle.id, "track_length": steps, "dataset": DATASET}
    return {"type": kind, "state": state, "metadata": metadata}


def _summary(track: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return what ScenarioNet's filters ask of a track."""
    valid, position = track["state"]["valid"], track["state"]["position"][:, :2].astype(np.float64)
    driven = position[valid]
    moved = float(edge_lengths(driven).sum())
    return {
        "type": track["type"],
        "object_id": name,
        "track_length": len(valid),
        "moving_distance": round(moved, 3),
        "distance": round(moved, 3),
        "valid_length": int(valid.sum()),
        "continuous_valid_length": int(valid.sum()),
    }


def _numbers(tracks: Mapping[str, Any]) -> dict[str, Any]:
    moving = Counter(
        track["type"]
        for name, track in tracks.items()
        if _summary(track, name)["moving_distance"] > MIN_MOVING_DISTANCE_M
    )
    each = Counter(track["type"] for track in tracks.values())
    return {
        "num_moving_objects": moving.total(),
        "num_moving_objects_each_type": {kind: moving[kind] for kind in sorted(each)},
        "num_objects": len(tracks),
        "object_types": sorted(each),
        "num_objects_each_type": dict(sorted(each.items())),
        "num_traffic_lights": 0,
        "num_traffic_light_types": [],
        "num_traffic_lights_each_step": {},
    }


def _lane(lane_map: LaneMap, k: int) -> dict[str, Any]:
    """Return lane k as a feature of the map."""
    network, sides = lane_map.network, lane_map.neighbours(k)
    lane = network.lanes[k]
    neighbours = {side: [str(other + 1)] for side, (other, same) in sides.items() if same}
    if not lane.open_to(DRIVERS):
        return {
            "type": "CROSSWALK" if lane.crossing else "SIDEWALK",
            "polygon": lane.outline.astype(np.float32),
        }
    return {
        "type": "LANE_BIKE_LANE"
        if lane.users and not lane.open_to(DRIVERS - {"bicycle"})
        else "LANE_SURFACE_STREET",
        "polyline": lane.centre.astype(np.float32),
        "polygon": lane.outline.astype(np.float32),
        "entry_lanes": [str(other + 1) for other in sorted(network.predecessors[k])],
        "exit_lanes": [str(other + 1) for other in sorted(lane.successors)],
        "left_neighbor": neighbours.get("left", []),
        "right_neighbor": neighbours.get("right", []),
    }


def dataset_files(described: Sequence[tuple[str, Mapping[str, Any]]]) -> dict[str, bytes]:
    """Return the files that make a folder a data set: the metadata of each scenario, and in which folder it lies.

    Args:
        described: file name and description of each scenario.
    """
    return {
        SUMMARY: pickled({name: whole["metadata"] for name, whole in described}),
        MAPPING: pickled(dict.fromkeys((name for name, _ in described), "")),
    }


def pickled(value: Any) -> bytes:
    """Return a value as a pickle that any NumPy reads."""
    stream = io.BytesIO()
    pickler = _Pickler(stream, protocol=4)
    pickler.fast = (
        True  # no references to what was written before: they depend on which texts are one object
    )
    pickler.dump(value)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    """Writes arrays as calls of `numpy.ndarray`: NumPy's own form names modules that differ between its versions."""

    def reducer_override(self, value: Any) -> Any:
        """Return how an array is made; anything else is written as usual."""
        if isinstance(value, np.ndarray):
            return np.ndarray, (
                value.shape,
                value.dtype.str,
                bytearray(np.ascontiguousarray(value).tobytes()),
            )
        return NotImplemented
