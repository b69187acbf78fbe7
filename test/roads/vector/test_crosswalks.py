# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Crosswalks of OpenDRIVE: objects with an outline about themselves or along the road, or with a length and a width."""

import numpy as np
import pytest
import shapely
from test_reported_maps import lane, read, road, section

ROUND = "".join(
    f'<cornerLocal u="{u}" v="{v}" z="0"/>'
    for u, v in ((2, 4), (-2, 4), (-2.5, 0), (-2, -4), (2, -4), (2.5, 0))
)
ALONG = "".join(
    f'<cornerRoad s="{s}" t="{t}"/>' for s, t in ((52, 4), (48, 4), (48, -4), (52, -4), (52, 4))
)


def crossing(more="", attributes='hdg="0"', kind="crosswalk"):
    return f'<objects><object type="{kind}" id="7" s="50" t="0" {attributes}>{more}</object></objects>'


@pytest.mark.parametrize(
    ("objects", "area"),
    [
        (crossing(f"<outlines><outline>{ROUND}</outline></outlines>"), 36.0),
        (crossing(f"<outline>{ALONG}</outline>"), 32.0),
        (crossing(attributes='hdg="0" length="4" width="8"'), 32.0),
        (crossing(attributes='hdg="1.5707963267948966" length="8" width="4"'), 32.0),
    ],
)
def test_crosswalk_leads_from_right_to_left(tmp_path, objects, area):
    network = read(tmp_path, road(section(right=lane(-1)), more=objects))
    (walk,) = network.others
    assert (walk.id, walk.crossing, sorted(walk.users)) == ("crosswalk 1.7", True, ["pedestrian"])
    assert np.allclose(walk.centre[[0, -1]], [[50.0, -4.0], [50.0, 4.0]], atol=1e-6)
    assert np.allclose(walk.yaw, np.pi / 2.0)
    assert shapely.Polygon(walk.outline).area == pytest.approx(area)
    assert walk.left[0, 0] < walk.right[0, 0]


def test_crosswalk_without_size_is_named(tmp_path):
    network = read(
        tmp_path, road(section(right=lane(-1)), more=crossing(attributes='length="0" width="0"'))
    )
    assert not network.others and any(
        "1 faulty crosswalk left out (crosswalk 1.7)" in str(note) for note in network.notes
    )
    assert not read(tmp_path, road(section(right=lane(-1)), more=crossing(kind="tree"))).others
