# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Broken primitive libraries: an error that names the file and the path inside it."""

import json

import numpy as np
import pytest
from support.crash_files import crash_files, is_refused

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation import PrimitiveLibrary


@pytest.mark.parametrize("file", crash_files("library/*"), indirect=True)
def test_a_broken_library_is_named(file):
    assert is_refused(lambda: PrimitiveLibrary.load(file), str(file))


@pytest.fixture
def document(tmp_path):
    library = PrimitiveLibrary(
        2,
        np.zeros((2, 6)),
        np.stack([np.eye(6)] * 2),
        np.full((2, 2), 0.5),
        [0.5, 0.5],
        [3, 4],
        [1.0, 2.0],
        0.5,
        [1, 2, 0.2, 0.4],
        ("a", "b"),
    )
    library.save(tmp_path / "library.json")
    assert PrimitiveLibrary.load(tmp_path / "library.json").descriptions == ("a", "b")
    return json.loads((tmp_path / "library.json").read_text())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"means": [[0.0] * 6, [0.0] * 5]}, r"means\[1\] holds 5 items where 6 are needed"),
        ({"vehicles": 3}, r"means\[0\] holds 6 items where 9 are needed"),
        (
            {"transition": [[0.5, 0.5], [0.5, 0.6]]},
            "transition holds probabilities; each row must sum to 1",
        ),
        ({"initial": [0.5, 1.5]}, r"initial\[1\] is 1\.5"),
        ({"covariances": [np.eye(6).tolist(), np.zeros((6, 6)).tolist()]}, "positive definite"),
        ({"weight": 1e308}, "weight is 1e"),
        ({"segments": [1, 2**80]}, r"segments\[1\]"),
        ({"windows": [1.0, 2.0, 0.2]}, "windows"),
        ({"descriptions": ["a"]}, "descriptions holds 1 items where 2 are needed"),
        ({"format": "another"}, "format is another"),
    ],
)
def test_what_is_wrong_is_named_with_its_path(document, tmp_path, change, said):
    (tmp_path / "library.json").write_text(json.dumps(document | change))
    with pytest.raises(InputError, match=rf"library\.json is not a primitive library: .*{said}"):
        PrimitiveLibrary.load(tmp_path / "library.json")
