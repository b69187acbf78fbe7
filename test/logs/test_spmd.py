# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages in the published layout of the Safety Pilot Model Deployment."""

import numpy as np
import pytest
from support.log_builders import crossing, geographic

from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log
from scenario_gen.logs.tables import SPMD_EPOCH_NS
from scenario_gen.logs.text import SPMD_COLUMNS

FIRST = 270_000_000_000_000  # Gentime: microseconds since 2004-01-01, in July 2012


def messages(rows):
    """The crossing of the builders as headerless lines of 19 columns."""
    out = geographic(rows)
    lines = []
    for number, row in enumerate(out.itertuples()):
        heading = 90.0 if row.vehicle_id == "a" else 0.0  # degrees clockwise from north
        fields = dict.fromkeys(SPMD_COLUMNS, "0") | {
            "RxDevice": "7",
            "FileId": "1",
            "TxDevice": "11" if row.vehicle_id == "a" else "12",
            "Gentime": str(FIRST + round((row.t_s - 1000.0) * 1e6)),
            "MsgCount": str(number % 128),
            "Latitude": f"{row.lat_deg:.7f}",
            "Longitude": f"{row.lon_deg:.7f}",
            "Speed": f"{row.speed_mps:.2f}",
            "Heading": f"{heading}",
            "Confidence": "100",
        }
        lines.append(",".join(fields[name] for name in SPMD_COLUMNS))
    return lines


def test_one_received_file(tmp_path):
    path = tmp_path / "TripStart_bsmrx_41090.csv"
    path.write_text("\n".join(messages(crossing())) + "\n")
    (encounter,) = read_log(path).encounters
    assert [vehicle.id for vehicle in encounter.vehicles] == ["11", "12"]
    assert encounter.start_ns == SPMD_EPOCH_NS + FIRST * 1000
    np.testing.assert_allclose(encounter.heading[0], 0.0, atol=0.02)
    np.testing.assert_allclose(encounter.heading[1], np.pi / 2.0, atol=0.02)
    np.testing.assert_allclose(encounter.speed[0], 8.0, atol=0.1)


def test_a_folder_of_transmitted_files(tmp_path):
    lines = messages(crossing())
    for device, name in (("11", "TripStart_41090_p001.csv"), ("12", "TripStart_41090_p002.csv")):
        (tmp_path / name).write_text(
            "\n".join(line for line in lines if line.split(",")[2] == device) + "\n"
        )
    result = read_log(tmp_path)
    assert len(result.encounters[0].vehicles) == 2
    assert result.quality.rows == 242


def test_standing_vehicle_has_its_messages_heading(tmp_path):
    rows = crossing()
    rows.loc[rows["vehicle_id"] == "b", ["x_m", "y_m", "speed_mps"]] = (10.0, -12.0, 0.0)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(messages(rows)) + "\n")
    np.testing.assert_allclose(read_log(path).encounters[0].heading[1], np.pi / 2.0, atol=1e-6)


def test_lines_that_break_off(tmp_path):
    lines = messages(crossing())
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*lines[:-1], lines[-1][:40]]))
    result = read_log(path)  # the last line lost its position: counted, with its place
    assert [(drop.reason, drop.count) for drop in result.quality.dropped] == [
        ("position is not a number", 1),
        ("speed is not a number", 1),
    ]
    assert result.quality.dropped[0].first.endswith("log.csv, line 242")
    path.write_text("\n".join([*lines[:50], lines[50] + ",1,2", *lines[51:]]))
    with pytest.raises(InputError, match=r"log\.csv.*line 51"):
        read_log(path)
