# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps that once broke the reader, and bombs: an error that names the map, or a road."""

import shutil

from fuzzing.crash_files import crash_files, is_refused
import pytest

from scenario_gen.roads import build_road


@pytest.mark.parametrize("file", crash_files("map/*.yaml", "*.yaml"), indirect=True)
def test_a_broken_map_is_named(file, tmp_path):
    shutil.copy(file, tmp_path / file.name)
    for image in (*file.parent.glob(f"{file.stem}__*"), *file.parent.glob("b?.png")):
        shutil.copy(image, tmp_path / image.name.rpartition("__")[2])
    assert is_refused(lambda: build_road(str(tmp_path / file.name), None), file.name)
