# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ScenarioNet's description: what MetaDrive's sanity check asks, the motion of the bag, and a data set that others list."""

import pickle
import pickletools

import numpy as np
import pytest

from scenario_gen.output.exchange.cases import read_cases
from scenario_gen.output.exchange.export import export_bag
from scenario_gen.output.exchange.scenarionet import DATASET, pickled


@pytest.fixture
def exported(small_bag, tmp_path):
    made = export_bag(small_bag, tmp_path / "out", "scenarionet")
    assert made.scenarios == 4
    return tmp_path / "out"


def described(folder):
    """Our own files, written a moment ago: nobody else's pickles are read."""
    return {path.name: pickle.loads(path.read_bytes()) for path in sorted(folder.glob("sd_*.pkl"))}


def test_each_scenario_is_fully_described(exported):
    for whole in described(exported).values():
        assert {
            "tracks",
            "version",
            "id",
            "dynamic_map_states",
            "map_features",
            "length",
            "metadata",
        } == set(whole)
        assert (
            whole["metadata"]["ts"].shape == (whole["length"],)
            and whole["metadata"]["sdc_id"] in whole["tracks"]
        )
        for name, track in whole["tracks"].items():
            assert track["metadata"]["object_id"] == name and track["type"] == "VEHICLE"
            state, valid = track["state"], track["state"]["valid"]
            assert all(len(values) == whole["length"] for values in state.values()) and valid.any()
            assert all(not np.asarray(values)[~valid].any() for values in state.values())
        for lane in whole["map_features"].values():
            assert lane["type"] == "LANE_SURFACE_STREET" and lane["polyline"].shape[1] == 2
            assert set(lane["exit_lanes"]) | set(lane["entry_lanes"]) <= set(whole["map_features"])


def test_motion_is_that_of_bag(small_bag, exported):
    wholes = described(exported)
    for case in read_cases(small_bag):
        for one in case.scenarios:
            whole = wholes[f"sd_scenario_gen_1_case_{case.number}_{one.index}.pkl"]
            ends = [
                track["state"]["position"][track["state"]["valid"]][0, :2]
                for track in whole["tracks"].values()
            ]
            starts = [
                one.others.position[n, one.others.present[n, 0]]
                for n in range(len(one.others.vehicles))
            ]
            np.testing.assert_allclose(ends[: len(starts)], starts, atol=1e-4)


def test_a_pickle_names_nothing_but_arrays(exported):
    """Every version of NumPy reads it, and it can run nothing."""
    for path in exported.glob("*.pkl"):
        texts = [
            argument
            for opcode, argument, _ in pickletools.genops(path.read_bytes())
            if opcode.name == "SHORT_BINUNICODE"
        ]
        modules = {
            text
            for text in texts
            if text.split(".")[0] in ("numpy", "builtins", "scenario_gen", "os", "pathlib")
        }
        assert modules - {DATASET} <= {"numpy", "builtins"}
    array = pickle.loads(pickled({"a": np.arange(6.0).reshape(2, 3)}))["a"]
    assert array.tolist() == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]] and array.flags.writeable
