# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of nav2's map_server."""

import numpy as np
from PIL import Image
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.roads import build_road
from scenario_gen.roads.config import RoadConfig

GOOD = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[1.0, 2.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.25",
}


def write(folder, pixels=None, **changes):
    keys = {**GOOD, **changes}
    if pixels is not None:
        Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(folder / "map.pgm")
    path = folder / "map.yaml"
    path.write_text(
        "".join(f"{key}: {value}\n" for key, value in keys.items() if value is not None)
    )
    return str(path)


def test_rows_turn_over_and_unknown_blocks(tmp_path):
    path = write(tmp_path, [[254, 205, 0], [0, 0, 254]], free_thresh="0.196")
    road = build_road(path, None)
    assert road.drivable.tolist() == [[False, False, True], [True, False, False]]
    assert road.origin.tolist() == [1.0, 2.0]
    assert road.resolution == float(np.float32(0.05))


@pytest.mark.parametrize(
    ("mode", "negate", "pixels", "drivable"),
    [
        ("trinary", "1", [[0, 100, 255]], [True, False, False]),
        ("scale", "0", [[255, 195, 0]], [True, True, False]),
        ("scale", "0", [[255, 185, 0]], [True, False, False]),
        ("raw", "0", [[0, 24, 100]], [True, True, False]),
        ("raw", "0", [[25, 0, 255]], [False, True, False]),
    ],
)
def test_modes_and_negate(tmp_path, mode, negate, pixels, drivable):
    assert (
        build_road(write(tmp_path, pixels, mode=mode, negate=negate), None).drivable[0].tolist()
        == drivable
    )


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("image", "nothing.pgm"),
        ("image", None),
        ("resolution", "-1"),
        ("resolution", "fine"),
        ("resolution", ".nan"),
        ("origin", "[0, 0, 0.5]"),
        ("origin", "here"),
        ("origin", "[0, .inf, 0]"),
        ("mode", "colour"),
        ("negate", "2"),
        ("free_thresh", "0.9"),
        ("occupied_thresh", "7"),
    ],
)
def test_unusable_value_is_named_by_key(tmp_path, key, value):
    path = write(tmp_path, [[254, 0]], **{key: value})
    with pytest.raises(InputError) as error:
        build_road(path, None)
    assert key in str(error.value)
    assert "map.yaml" in str(error.value)


def test_broken_files_are_errors_too(tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P5\n10 10\n255\nshort")
    with pytest.raises(InputError, match=r"map\.pgm"):
        build_road(write(tmp_path), None)
    (tmp_path / "list.yaml").write_text("- 1\n")
    with pytest.raises(InputError, match=r"list\.yaml"):
        build_road(str(tmp_path / "list.yaml"), None)
    with pytest.raises(InputError, match=r"absent\.yaml"):
        build_road(str(tmp_path / "absent.yaml"), None)
    with pytest.raises(InputError, match="free"):
        build_road(write(tmp_path, [[0, 0]]), None)


def test_outside_image_is_read_on_request(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    Image.fromarray(np.array([[254, 0]], dtype=np.uint8)).save(tmp_path / "other.pgm")
    (folder / "link.pgm").symlink_to(tmp_path / "other.pgm")
    (folder / "loop.pgm").symlink_to(folder / "loop.pgm")
    for name in ("../other.pgm", str(tmp_path / "other.pgm"), "link.pgm"):
        path = write(folder, image=name)
        with pytest.raises(InputError, match=r"road\.image_outside_folder=true"):
            build_road(path, None)
        assert build_road(path, None, RoadConfig(image_outside_folder=True)).drivable.sum() == 1
    with pytest.raises(InputError, match="loop"):
        build_road(write(folder, image="loop.pgm"), None)


def test_folder_of_links_is_not_outside(tmp_path):
    source, installed = tmp_path / "source", tmp_path / "installed"
    source.mkdir()
    installed.mkdir()
    write(source, [[254, 0]])
    for name in ("map.yaml", "map.pgm"):
        (installed / name).symlink_to(source / name)
    assert build_road(str(installed / "map.yaml"), None).drivable.sum() == 1


def test_large_images_are_refused_unread(tmp_path):
    path = write(tmp_path, np.full((30, 40), 254))
    with pytest.raises(InputError, match=r"40 x 30 pixels, more than road\.max_cells \(1199\)"):
        build_road(path, None, RoadConfig(max_cells=1199))
    assert build_road(path, None, RoadConfig(max_cells=1200)).drivable.all()
    (tmp_path / "bomb.pgm").write_bytes(b"P5 20000 20000 255\n")
    with pytest.raises(InputError, match=r"bomb\.pgm.*400000000 pixels"):
        build_road(write(tmp_path, image="bomb.pgm"), None)


def test_other_image_formats_are_refused(tmp_path):
    Image.fromarray(np.full((4, 4), 254, dtype=np.uint8)).save(tmp_path / "map.tga")
    with pytest.raises(InputError, match=r"map\.tga.*give PGM, PPM, PBM, PNG, BMP or JPEG"):
        build_road(write(tmp_path, image="map.tga"), None)


def test_impossible_cells_are_refused(tmp_path):
    with pytest.raises(InputError, match="resolution"):
        build_road(write(tmp_path, [[254, 0]], resolution="1e9"), None)


def test_every_recorded_map_is_read(data):
    paths = sorted((data / "maps").glob("*/*.yaml"))
    assert paths
    for path in paths:
        road = build_road(str(path), None)
        assert 0.01 < road.drivable.mean() < 0.99, path.name
