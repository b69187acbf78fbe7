# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Primitives shared by encounters: built, saved, loaded, assigned."""

import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation import assign, build_library, PrimitiveLibrary


def stop_and_go(encounter_of, seed, shift):
    """Vehicle 0 stands; vehicle 1 cruises, brakes to a stop, stands, pulls away at 2 m/s²."""
    t = np.arange(250) * 0.1
    other = np.interp(t, np.array([0, 5, 10, 15, 20, 25]) + shift, [10, 10, 0, 0, 10, 10])
    return encounter_of(np.array([np.zeros(250), other]), noise=0.05, seed=seed)


@pytest.fixture(scope="module")
def built(encounter_of):
    return build_library([stop_and_go(encounter_of, s, 0.5 * s) for s in range(4)], seed=1)


def test_states_are_shared(built):
    library, assignments = built
    assert 4 <= len(library.means) <= 6
    assert library.segments.sum() == sum(len(a.primitives) for a in assignments)
    common = set.intersection(*(set(a.primitives.tolist()) for a in assignments))
    assert len(common) >= 4
    assert any("vehicle 0 stands, vehicle 1 brakes at" in d for d in library.descriptions)
    assert any(d == "vehicle 0 stands, vehicle 1 stands" for d in library.descriptions)
    np.testing.assert_allclose(library.transition.sum(axis=1), 1.0)


def test_saved_and_loaded_is_the_same(built, tmp_path):
    library, _ = built
    library.save(tmp_path / "library.json")
    again = PrimitiveLibrary.load(tmp_path / "library.json")
    for name in library.__dataclass_fields__:
        a, b = getattr(library, name), getattr(again, name)
        assert a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b


def test_new_encounter_is_assigned_without_fitting(built, encounter_of):
    library, _ = built
    found = assign(stop_and_go(encounter_of, 9, 0.3), library)
    said = [library.descriptions[k] for k in found.primitives]
    assert [("stands" in d.split(", ")[1]) for d in said] == [False, False, True, False, False]
    assert np.abs(found.segmentation.changepoints - [53, 103, 153, 203]).max() <= 8


def test_refusals(built, encounter_of, tmp_path):
    library, _ = built
    with pytest.raises(InputError, match="vehicles"):
        assign(encounter_of(np.ones((3, 50))), library)
    with pytest.raises(InputError, match="one number of vehicles"):
        build_library([encounter_of(np.ones((3, 50))), encounter_of(np.ones((2, 50)))])
    with pytest.raises(InputError, match="one number of vehicles"):
        build_library([])
    broken = tmp_path / "broken.json"
    broken.write_text("{}")
    with pytest.raises(InputError, match="not a primitive library"):
        PrimitiveLibrary.load(broken)
    with pytest.raises(InputError, match="cannot be read"):
        PrimitiveLibrary.load(tmp_path / "missing.json")
