# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

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
