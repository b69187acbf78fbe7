# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters: names, values that are refused, and the reference that is made of them."""

import csv
from dataclasses import dataclass, field
import runpy

import pytest
from support.source_files import ROOT
import yaml

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten, parameter, Parameters, updated
from scenario_gen.logs import LogConfig
from scenario_gen.method.config import PipelineConfig


@dataclass(frozen=True)
class Inner(Parameters):
    gain: float = parameter(0.5, "how much", unit="m", low=0.0, high=1.0)
    mode: str = parameter("a", "which", choices=("a", "b"))


@dataclass(frozen=True)
class Outer:
    inner: Inner = field(default_factory=Inner)
    count: int = parameter(3, "how many", low=1)
    on: bool = parameter(True, "whether")


def test_reference_has_defaults_and_ranges():
    """Help texts aside, so a better one needs no new table at once."""
    reference = runpy.run_path(ROOT / "docs" / "tables.py")
    text = reference["DEFAULT_YAML"].read_text(encoding="utf-8")
    nested = yaml.safe_load(text)["/**"]["ros__parameters"]
    values = {f"{head}.{name}": value for head in nested for name, value in nested[head].items()}
    assert values == {name: value for name, (_, value) in flatten(PipelineConfig()).items()}
    assert text == reference["default_yaml"](), "run: python docs/tables.py"
    table = (reference["FOLDER"] / "parameters.csv").read_text(encoding="utf-8")
    rows = [
        [row[:-1] for row in csv.reader(lines.splitlines())]
        for lines in (table, reference["tables"]()["parameters.csv"])
    ]
    assert rows[0] == rows[1], "run: python docs/tables.py"


def test_updated_sets_nested_values():
    config = updated(Outer(), {"inner.gain": 1, "on": False})
    assert config.inner.gain == 1.0 and isinstance(config.inner.gain, float)
    assert not config.on and config.count == 3 and Outer().inner.gain == 0.5


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("inner.gain", 2.0, "inner.gain is 2.0; it must be at most 1.0 m"),
        ("inner.gain", float("nan"), "give a finite number"),
        ("inner.gain", float("inf"), "give a finite number"),
        ("inner.mode", "c", "choose one of a, b"),
        ("count", 0, "at least 1"),
        ("count", True, "a whole number"),
        ("count", 2.5, "a whole number"),
        ("on", 1, "true or false"),
        ("inner", 1, "unknown parameter inner"),
        ("inner.loss", 1, "unknown parameter inner.loss"),
        ("count.x", 1, "unknown parameter count.x"),
    ],
)
def test_a_bad_value_is_named(name, value, said):
    with pytest.raises(InputError, match=said):
        updated(Outer(), {name: value})


def test_text_takes_mappings_and_lists():
    log = updated(LogConfig(), {"columns": {"time": "t", "x": "px:ft"}, "vehicles": ["1", 2]})
    assert (log.columns, log.vehicles) == ("time=t,x=px:ft", "1,2")
