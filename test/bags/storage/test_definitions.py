# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The definitions that are kept, against rosbags, which they come from."""

import pytest

from msg_conventions import diagnostics, paths, pictures, roads, trajectory
from scenario_gen.bags.storage.definitions import definition, stored_definitions, type_store


@pytest.mark.parametrize("kind", sorted(stored_definitions()))
def test_stored_definition_is_that_of_rosbags(kind):
    text, _ = type_store().generate_msgdef(kind, ros_version=2)
    assert definition(kind) == (text, type_store().hash_rihs01(kind))


def test_writing_loads_no_rosbags_types():
    kinds = {diagnostics.TYPE, pictures.MARKER_TYPE, paths.TYPE, trajectory.TYPE}
    kinds |= {pictures.FOOTPRINT_TYPE, roads.MAP_TYPE, roads.POSES_TYPE}
    assert kinds <= stored_definitions().keys()
