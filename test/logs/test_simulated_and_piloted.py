# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages in JSON of the US pilots, and floating-car data of SUMO: the drive of a table."""

import gzip
import json

import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, geographic, save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log


def drive():
    rows = crossing()
    rows["course"] = np.where(rows.vehicle_id == "a", 90.0, 0.0)
    return rows.join(geographic(rows)[["lat_deg", "lon_deg"]])


def message(row, core):
    at = pd.Timestamp(row.t_s + 0.03, unit="s", tz="UTC")  # when it was received
    core |= {
        "id": f"0{row.vehicle_id}E1",
        "secMark": round(row.t_s * 1000) % 60_000,
        "size": {"length": 450, "width": 180},
    }
    return {
        "metadata": {"recordGeneratedAt": f"{at:%Y-%m-%dT%H:%M:%S.%f}Z[UTC]"},
        "payload": {"data": {"coreData": core}},
    }


def wyoming(row):
    place = {"latitude": row.lat_deg, "longitude": row.lon_deg}
    return message(row, {"position": place, "speed": row.speed_mps, "heading": row.course})


def tampa(row):
    raw = {
        "lat": row.lat_deg * 1e7,
        "long": row.lon_deg * 1e7,
        "speed": row.speed_mps / 0.02,
        "heading": row.course / 0.0125,
    }
    return message(row, {name: str(round(value)) for name, value in raw.items()})


def new_york(row):
    core = {
        "id": f"0{row.vehicle_id}E1",
        "X_m": row.x_m,
        "Y_m": row.y_m,
        "T_s": row.t_s - 1006.0,
        "size": {"length": 450, "width": 180},
    }
    return {
        "bsmRecord": {
            "bsmMsg": {"coreData": core | {"speed_mps": row.speed_mps, "heading_deg": row.course}}
        }
    }


def as_table(records):
    """The messages as they stand on data.transportation.gov, where dates are to the second."""
    rows = []
    for record in records:
        core = record["payload"]["data"]["coreData"]
        place = core.get("position", {"latitude": core.get("lat"), "longitude": core.get("long")})
        own = {
            f"coreData_{name}": core[name] for name in ("id", "secMark", "speed", "heading")
        } | {"coreData_size": json.dumps(core["size"])}
        own |= {
            "coreData_position_lat": place["latitude"],
            "coreData_position_long": place["longitude"],
            "randomNum": 0.5,
        }
        rows.append(
            {
                "metadata_generatedAt": record["metadata"]["recordGeneratedAt"][:19].replace(
                    "T", " "
                )
            }
            | own
        )
    return pd.DataFrame(rows).to_csv(index=False)


@pytest.mark.parametrize("pilot", [wyoming, tampa, new_york])
def test_messages_of_the_pilots(tmp_path, pilot):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    records = [pilot(row) for row in drive().itertuples()]
    texts = {
        "lines": "\n".join(map(json.dumps, records)),
        "list": json.dumps(records),
        "pretty": "".join(json.dumps(r, indent=1) for r in records),
    }
    if pilot is new_york:
        texts = {
            "events": "\n".join(
                json.dumps({"eventHeader": {}, "bsmList": records}) for _ in range(2)
            )
        }
    names = {f"{name}.json": text for name, text in texts.items()}
    names |= {} if pilot is new_york else {"table.csv": as_table(records)}
    for name, own in names.items():
        (tmp_path / name).write_text(own)
        found = read_log(tmp_path / name).encounters
        assert len(found) == (2 if pilot is new_york else 1)
        for encounter in found:
            assert [(one.id, one.length, one.width) for one in encounter.vehicles] == [
                ("0aE1", 4.5, 1.8),
                ("0bE1", 4.5, 1.8),
            ]
            np.testing.assert_allclose(
                np.ptp(encounter.position[:2], axis=1), np.ptp(plain.position, axis=1), atol=0.3
            )
            np.testing.assert_allclose(encounter.heading[1], np.pi / 2.0, atol=0.02)
    (tmp_path / "cut.json").write_text(own[:-20] if pilot is new_york else texts["pretty"][:-20])
    with pytest.raises(InputError, match=r"cut\.json"):
        read_log(tmp_path / "cut.json", LogConfig(format="bsm"))


@pytest.mark.parametrize("geo", [False, True])
def test_floating_car_data(tmp_path, geo):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    steps = []
    for time, rows in drive().groupby("t_s"):
        front = (2.4, 0.0), (0.0, 2.4)
        own = [
            f'<vehicle id="{row.vehicle_id}" x="{row.lon_deg if geo else row.x_m + x}" y="{row.lat_deg if geo else row.y_m + y}" '
            f'angle="{row.course}" speed="{row.speed_mps}" type="DEFAULT_VEHTYPE"/>'
            for row, (x, y) in zip(rows.itertuples(), front, strict=True)
        ]
        steps.append(
            f'<timestep time="{time:.2f}">{"".join(own)}<person id="p" x="1" y="2"/></timestep>'
        )
    text = f'\n<?xml version="1.0" encoding="UTF-8"?>\n<!-- {"options " * 2000} -->\n<fcd-export>{"".join(steps)}</fcd-export>'
    with gzip.open(tmp_path / "fcd.xml.gz", "wt") as file:
        file.write(text)
    result = read_log(tmp_path / "fcd.xml.gz")
    (encounter,) = result.encounters
    np.testing.assert_allclose(
        np.ptp(encounter.position[:2], axis=1), np.ptp(plain.position, axis=1), atol=0.3
    )
    assert [vehicle.type for vehicle in encounter.vehicles] == (
        ["car", "car"] if geo else ["car", "car", "pedestrian"]
    )
    if not geo:
        np.testing.assert_allclose(encounter.position[:2], plain.position, atol=0.1)
