# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A trailer with a track of its own, or named by a column, belongs to the vehicle that tows it."""

import numpy as np
import pytest

from scenario_gen.logs import read_log
from scenario_gen.types import Trailer

HEADER = "time,id,x,y,heading,speed,length,width,type"


def log(tmp_path, *, kind="trailer", slower=0.0, trailer=None):
    """A truck that brakes and drives on, what is 9.5 m behind it, and an oncoming car."""
    names = HEADER + (",trailer" if trailer is not None else "")
    lines = [names]
    for k in range(121):
        t = 0.1 * k
        x = 7.0 * t + 5.0 * np.sin(0.5 * t)
        v = 7.0 + 2.5 * np.cos(0.5 * t)
        rows = [
            f"{x},-1.75,0,{v},7,2.5,truck",
            f"{x - 9.5 - slower * t},-1.75,0,{v - slower},8,2.5,{kind}",
            f"{100.0 - 8.0 * t},1.75,{np.pi},8,4.6,1.9,car",
        ]
        for name, row in zip(("t", "tl", "c"), rows, strict=True):
            more = "" if trailer is None else f",{trailer if name == 't' else ''}"
            if name != "tl" or kind:
                lines.append(f"{t:.1f},{name},{row}{more}")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    return read_log(path)


@pytest.mark.parametrize("kind, trailer", [("trailer", None), ("truck", None), ("car", "tl")])
def test_what_keeps_distance_is_a_trailer(tmp_path, kind, trailer):
    result = log(tmp_path, kind=kind, trailer=trailer)
    (encounter,) = result.encounters
    truck = encounter.vehicles[encounter.ids.index("t")]
    assert set(encounter.ids) == {"t", "c"} and truck.trailer.id == "tl"
    assert truck.trailer.hitch + truck.trailer.reach == pytest.approx(9.5, abs=0.05)
    assert any(note.startswith("vehicle tl is the trailer of t") for note in result.quality.notes)
    assert not any("no encounter" in note for note in result.quality.notes)


def test_who_falls_behind_is_none(tmp_path):
    (encounter,) = log(tmp_path, kind="truck", slower=0.2).encounters
    assert set(encounter.ids) == {"t", "tl", "c"}
    assert all(vehicle.trailer is None for vehicle in encounter.vehicles)


@pytest.mark.parametrize("trailer, length", [("6.5", 6.5), ("false", None), ("yes", None)])
def test_a_column_may_have_its_length(tmp_path, trailer, length):
    result = log(tmp_path, kind="", trailer=trailer)
    vehicles = {vehicle.id: vehicle for vehicle in result.encounters[0].vehicles}
    expected = length and Trailer("t_trailer", length, 2.5, 3.5, 1.0 + length / 2.0)
    assert vehicles["t"].trailer == expected
    said = any("has the trailer yes; left out" in note for note in result.quality.notes)
    assert said == (trailer == "yes")
