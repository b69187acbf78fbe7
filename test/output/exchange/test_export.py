# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""scenario-gen export and import as commands: every format, the same bytes twice, some scenarios, an ego, and what is refused."""

import json
import xml.etree.ElementTree as ET

import numpy as np
import pyproj
import pytest
from rosbags.rosbag2 import Reader
from support.bag_examples import hand_made_run
from support.map_builders import lanelet2, opendrive
from support.source_files import content
from typer.testing import CliRunner

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.definitions import type_store
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.cli.commands import app
from scenario_gen.logs import read_log
from scenario_gen.logs.geodesy import geodetic
from scenario_gen.output.exchange.cases import read_cases
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.export import export_bag, EXPORTS, MANIFEST
from scenario_gen.pipeline import generate


@pytest.mark.parametrize("target", EXPORTS.built_in)
def test_same_bag_gives_same_bytes(small_bag, tmp_path, target):
    for name in ("one", "two"):
        made = export_bag(small_bag, tmp_path / name, target)
        assert made.scenarios == 4
    first, second = (content(tmp_path / name) for name in ("one", "two"))
    assert first.keys() == second.keys() and all(
        first[name] == second[name] for name in first if "metadata" not in name
    )
    manifest = json.loads(first[MANIFEST])
    assert {entry["sha256"] for entry in manifest["scenarios"]} == {
        sha256
        for namespace in read_recording(small_bag).namespaces.values()
        for sha256 in namespace.hashes
    }
    for entry in manifest["scenarios"]:
        assert all((tmp_path / "one" / name).exists() for name in entry["files"])


def test_chosen_scenario_with_ego_is_exported(small_bag, tmp_path):
    out = tmp_path / "out"
    words = f"export {small_bag} --to autoware --out {out} --index 8 --namespace t --ego 2"
    result = CliRunner().invoke(app, words, catch_exceptions=False)
    assert result.exit_code == 0 and "1 scenarios" in result.output
    (folder,) = [path for path in out.iterdir() if path.is_dir()]
    with Reader(folder) as reader:  # as others read it
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        for connection, _, data in reader.messages():
            type_store().deserialize_cdr(data, connection.msgtype)
    assert set(counts) == {
        "/localization/kinematic_state",
        "/perception/object_recognition/objects",
        "/perception/object_recognition/tracking/objects",
    }
    (entry,) = json.loads((out / MANIFEST).read_text())["scenarios"]
    assert (entry["index"], entry["ego"], entry["vehicles"]) == (8, "2", ["1"])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--to", "lanelet2"],
            "is none of the exports commonroad, openscenario, autoware, scenarionet",
        ),
        (
            ["--to", "commonroad", "--ego", "9"],
            "no vehicle '9' to be the ego; it has 1, 2",
        ),
        (["--to", "osi"], "--to osi was removed: export openscenario"),
        (["--to", "commonroad", "--index", "77"], "no scenario 77; it has "),
        (["--to", "commonroad", "--namespace", "x"], "no scenarios in namespace 'x'"),
        (["--to", "commonroad", "--set", "run_out=-1"], "run_out"),
    ],
)
def test_impossible_exports_are_refused(small_bag, tmp_path, options, said):
    with pytest.raises(InputError) as error:
        CliRunner().invoke(
            app,
            ["export", str(small_bag), "--out", str(tmp_path / "o"), *options],
            catch_exceptions=False,
        )
    assert said in str(error.value)
    assert not (tmp_path / "o").exists()


def made_on(path, text):
    """A bag of scenarios of two that drive behind each other, on a map."""
    path.write_text(text)
    log = path.with_name("log.csv")
    rows = [f"1,{k / 10:.1f},{-50.0 + k:.2f},-1.75,10.0" for k in range(95)]
    rows += [f"2,{k / 10:.1f},{-30.0 + k * 0.9:.2f},-1.75,9.0" for k in range(95)]
    log.write_text("\n".join(["vehicle_id,time,x,y,speed", *rows]) + "\n")
    (encounter,) = read_log(str(log)).encounters
    return path, generate(encounter, str(path), count=2, seed=1).save(path.with_name("bag"))


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """A map of the user's, and a bag of scenarios on it."""
    return made_on(tmp_path_factory.mktemp("town") / "town.xodr", opendrive())


ORIGIN = (59.9, 5.2)  # in Norway, whose zone of UTM is wider


def in_degrees(x, y):
    latitude, longitude = geodetic(np.array([x, y]), ORIGIN)
    return f'lat="{float(latitude)!r}" lon="{float(longitude)!r}">'


@pytest.fixture(scope="module")
def geographic_town(tmp_path_factory):
    """The same of a map in latitude and longitude."""
    return made_on(tmp_path_factory.mktemp("geographic") / "town.osm", lanelet2(in_degrees))


@pytest.mark.parametrize(
    ("projection", "origin", "zero"),
    [
        ("mgrs", "", (200_000.0, 6_600_000.0)),
        ("utm", "", (0.0, 0.0)),
        ("utm", "60, 5", None),
        ("local", "60, 5", None),
        ("local", "", None),
    ],
)
def test_map_in_degrees_keeps_its_frame(geographic_town, tmp_path, projection, origin, zero):
    path, bag = geographic_town
    config = ExportConfig(map=str(path), projection=projection, projection_origin=origin)
    made = export_bag(bag, tmp_path / "out", "openscenario", config)
    assert ("positions in " in made.notes[0]) == (projection != "local" or bool(origin))
    (one, *_), (entry, *_) = (
        read_cases(bag)[0].scenarios,
        json.loads((tmp_path / "out" / MANIFEST).read_text())["scenarios"],
    )
    root = ET.parse(tmp_path / "out" / entry["files"][0]).getroot()
    utm = pyproj.Transformer.from_crs(4326, 32632)
    near = pyproj.Transformer.from_crs(
        4326, f"+proj=aeqd +lat_0={origin[:2]} +lon_0={origin[3:]}" if origin else 32632
    )
    for n, follow in enumerate(root.iter("FollowTrajectoryAction")):
        places = [place.attrib for place in follow.iter("WorldPosition")]
        x, y, heading = (np.array([float(place[key]) for place in places]) for key in "xyh")
        ahead = 0.3 * one.others.vehicles[n].length  # of the rear axle
        fix = np.stack([x + ahead * np.cos(heading), y + ahead * np.sin(heading)], axis=-1)
        degrees = geodetic(one.others.position[n], ORIGIN)
        wanted = np.stack((near if projection == "local" else utm).transform(*degrees), axis=-1)
        if zero is None:
            zero = utm.transform(60.0, 5.0) if projection == "utm" else (0.0, 0.0)
        if projection == "local" and not origin:
            wanted = one.others.position[n]
        assert np.abs(fix - (wanted - zero)).max() < 1e-3
        step = np.gradient(wanted, axis=0)
        assert np.abs(np.sin(heading - np.arctan2(step[:, 1], step[:, 0])))[1:-1].max() < 5e-3


def test_scenarios_are_exported_on_user_map(town, tmp_path):
    path, bag = town
    made = export_bag(bag, tmp_path / "out", "openscenario", ExportConfig(map=str(path)))
    assert made.scenarios == 2 and "the lanes of town.xodr" in made.notes[0]
    assert sorted(file.name for file in (tmp_path / "out").glob("*.xodr")) == ["town.xodr"]
    assert (tmp_path / "out" / "town.xodr").read_bytes() == path.read_bytes()
    files = sorted((tmp_path / "out").glob("*.xosc"))
    assert [ET.parse(file).find("RoadNetwork/LogicFile").attrib["filepath"] for file in files] == [
        "town.xodr"
    ] * 2


@pytest.mark.parametrize("target", ["commonroad", "openscenario", "scenarionet"])
def test_export_refuses_grids_without_lanes(tmp_path, target):
    bag = write_recording(tmp_path / "bag", hand_made_run())
    with pytest.raises(RefusedError, match="left out: the road is a grid without lanes"):
        export_bag(bag, tmp_path / "out", target)
    assert not (tmp_path / "out").exists()
    assert export_bag(bag, tmp_path / "csv", "csv").scenarios == 5


def test_another_map_is_refused(town, small_bag, tmp_path):
    path, bag = town
    with pytest.raises(
        InputError,
        match=r"town\.xodr: \d+ % of the positions of .* lie on its lanes; name the map",
    ):
        export_bag(small_bag, tmp_path / "out", "openscenario", ExportConfig(map=str(path)))
    with pytest.raises(InputError, match="a map can be given with --to openscenario"):
        export_bag(bag, tmp_path / "out", "commonroad", ExportConfig(map=str(path)))
    with pytest.raises(InputError, match=r"OpenDRIVE \(\.xodr\) or Lanelet2"):
        export_bag(
            bag, tmp_path / "out", "openscenario", ExportConfig(map=str(bag / "metadata.yaml"))
        )
    assert not (tmp_path / "out").exists()
