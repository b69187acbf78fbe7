# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps that once broke the reader, and bombs: an error that names the map, or a road."""

import shutil

from fuzzing import broken
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.roads import build_road

MAPS = [n for n in broken.FILES if n.endswith(".yaml") and n.partition("/")[0] in (n, "map")]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return broken.write(tmp_path_factory.mktemp("broken"))


@pytest.mark.parametrize("name", MAPS)
def test_a_broken_map_is_named(name, made, tmp_path):
    file = made / name
    shutil.copy(file, tmp_path / file.name)
    for image in (*file.parent.glob(f"{file.stem}__*"), *file.parent.glob("b?.png")):
        shutil.copy(image, tmp_path / image.name.rpartition("__")[2])
    try:
        build_road(str(tmp_path / file.name), None)
    except InputError as error:
        assert file.name in str(error) and len(str(error)) <= 500
