# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Public definitions have docstrings, with shapes, units and what is raised; see `docstrings.py`."""

from docstrings import lacking, PACKAGES, ROOT
import pytest

PLACES = [
    *sorted(p for p in (ROOT / "scenario_gen").iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()),
    ROOT / PACKAGES[1],
]
EXAMPLE = '''
def bare(): ...
def shapeless(a: Floats) -> float:
    """Length [m]."""
def unitless(a: Floats) -> float:
    """Length of a line (P, 2)."""
def silent(a: int) -> None:
    """Check."""
    raise InputError("no")
def _private(): ...
class Box:
    """A box (cornered)."""
    side: Floats
'''


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name)
def test_docstrings_are_complete(place):
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
    assert not [f"{path.name}:{line}: {name}: {what}" for path in files for line, name, what in lacking(path)]


def test_what_is_lacking_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr("docstrings.ROOT", tmp_path)
    (tmp_path / "a.py").write_text(EXAMPLE)
    assert [(name, what) for _, name, what in lacking(tmp_path / "a.py")] == [
        ("a", "no docstring"),
        ("bare", "no docstring"),
        ("shapeless", "no shape"),
        ("unitless", "no unit"),
        ("silent", "no Raises: (InputError)"),
        ("Box", "no shape"),
    ]
