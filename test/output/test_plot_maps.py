# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A map as a picture: every lane, arrows at its arms, the places where a template fits; and the command `roads`."""

from PIL import Image
import pytest
from support.map_builders import lanelet2, opendrive
from support.source_files import ROOT
from typer.testing import CliRunner

from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.output.plot import draw_map
from scenario_gen.roads import read_network


def run(*words):
    """What the command prints."""
    return CliRunner().invoke(app, list(map(str, words)), catch_exceptions=False).output


@pytest.mark.parametrize(("suffix", "text"), [(".osm", lanelet2()), (".xodr", opendrive())])
def test_a_map_is_drawn_and_described(tmp_path, suffix, text):
    path = tmp_path / f"a & <b>{suffix}"
    path.write_text(text)
    network = read_network(path)
    said = draw_map(str(path), tmp_path / "map.png")
    assert Image.open(tmp_path / "map.png").size == (1600, 1200)
    assert said[0].startswith(f"a & <b>: {len(network.lanes)} lanes, ")


def test_suitable_built_in_roads_are_listed(tmp_path):
    log = ROOT / "examples" / "my_log.csv"
    assert (
        run("roads")
        == "roads: straight, curve, t_intersection, four_way, merge, roundabout, corridor\n"
    )
    assert run("roads", "--log", log) == "roads that suit my_log: four_way, corridor\n"
    assert run("roads", "four_way", "--out", tmp_path / "four.png").startswith("four_way: ")
    assert Image.open(tmp_path / "four.png").format == "PNG"


def test_nothing_of_the_user_is_overwritten(tmp_path):
    (tmp_path / "mine.png").write_text("<!-- mine -->")
    for name in ("mine.png", "mine.txt"):
        with pytest.raises(InputError, match="--out "):
            run("roads", "four_way", "--out", tmp_path / name)
    assert (tmp_path / "mine.png").read_text() == "<!-- mine -->" and not (
        tmp_path / "mine.txt"
    ).exists()
