# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The difference of failures of two planners, or two versions, on the same scenarios."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.documents import parse_json, read_text
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import values_of
from scenario_gen.closed_loop.bars import FIGURES, figures_of
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import units_of
from scenario_gen.closed_loop.trials import CONFIDENCE, Outcome
from scenario_gen.method.evaluation import paired_difference
from scenario_gen.types import Interval

MAX_FILE_BYTES = 64 * 1024 * 1024  # of a drives.json; a drive has about 2 kB
_DRIVE = {
    "type": "object",
    "properties": {
        "name": {"type": "string"},
        "scenario": {"type": "string"},
        "passed": {"type": "boolean"},
        **{name: {"type": ["number", "null"]} for name in FIGURES},
    },
    "required": ["name", "scenario", "passed"],
}
DRIVES = {
    "type": "object",
    "properties": {
        "planner": {"type": "string"},
        "parameters": {"type": "object"},
        "drives": {"type": "array", "items": _DRIVE},
    },
    "required": ["planner", "parameters", "drives"],
}
UNCOMPARED = {"drive_time", "repeat"}
"""Parameters that change no verdict."""


@dataclass(frozen=True)
class Earlier:
    """The drives of an earlier planner, from a drives.json.

    Attributes:
        planner: its name.
        parameters: the parameters of the drives.
        drives: by name of the scenario its digest (`scenario`), whether the planner passed
            (`passed`), and the figures of the drive, as far as they are known.
    """

    planner: str
    parameters: dict[str, Any]
    drives: pd.DataFrame


@dataclass(frozen=True)
class Comparison:
    """The comparison of a planner with an earlier one.

    Attributes:
        planner: name of the earlier planner.
        difference: share of failures minus that of the earlier planner, with its 95 % interval;
            positive is worse.
        now_fail: names of scenarios in which only the earlier planner passed.
        now_pass: names of scenarios in which only this planner passed.
        of: number of scenarios.
        encounters: number of encounters that the scenarios come from.
        figures: mean differences of the figures in `FIGURES` over the drives in which both have
            them, with intervals that all hold with 95 % together; without those that never differ.
    """

    planner: str
    difference: Interval
    now_fail: tuple[str, ...]
    now_pass: tuple[str, ...]
    of: int
    encounters: int
    figures: Mapping[str, Interval] = field(default_factory=dict)

    @property
    def worse(self) -> bool:
        """Whether it fails significantly more often, or a figure is significantly riskier."""
        risks = (
            share.high < 0.0 if FIGURES[name].low_is_risky else share.low > 0.0
            for name, share in self.figures.items()
        )
        return self.difference.low > 0.0 or any(risks)

    def sentence(self) -> str:
        """Return the comparison in words."""
        share = self.difference
        interval = f"{100.0 * share.low:+.1f} to {100.0 * share.high:+.1f}"
        parts = [
            f"against {self.planner}: failures {100.0 * share.value:+.1f} % ({interval}) on the "
            f"same {self.of} scenarios",
            f"{len(self.now_fail)} now fail, {len(self.now_pass)} now pass",
        ]
        for name, mean in self.figures.items():
            unit, interval = FIGURES[name].unit, f"{mean.low:+.2f} to {mean.high:+.2f}"
            parts.append(f"mean {name} {mean.value:+.2f} {unit} ({interval})")
        return "; ".join(parts)

    def document(self) -> dict[str, Any]:
        """Return the comparison as JSON's types."""
        return {
            "planner": self.planner,
            "difference": asdict(self.difference),
            "figures": {name: asdict(mean) for name, mean in self.figures.items()},
            "now_fail": list(self.now_fail),
            "now_pass": list(self.now_pass),
            "worse": self.worse,
        }


def read_drives(path: Path) -> Earlier:
    """Read a drives.json, or the one in a folder.

    Raises:
        InputError: the file is missing or invalid, or an older one without digests.
    """
    file = path / "drives.json" if path.is_dir() else path
    name = f"--against {file} (must be a drives.json from `scenario-gen drive`)"
    document = parse_json(read_text(file, MAX_FILE_BYTES, name), name, DRIVES)
    drives = pd.DataFrame(document["drives"], columns=["name", "scenario", "passed", *FIGURES])
    return Earlier(document["planner"], document["parameters"], drives.set_index("name"))


def refuse_others(digests: Mapping[str, str], config: ClosedLoopConfig, earlier: Earlier) -> None:
    """Check that earlier drives have the same scenarios (`digests` by name) and parameters.

    Raises:
        InputError: they differ; the message names the first scenario, or the parameters.
    """
    parameters = values_of(config)
    names = (parameters.keys() | earlier.parameters.keys()) - UNCOMPARED
    differ = sorted(name for name in names if parameters.get(name) != earlier.parameters.get(name))
    if differ:
        raise InputError(
            f"--against: driven with other parameters ({', '.join(differ)}); "
            "use the same ones, or drive the earlier planner again"
        )
    known = earlier.drives.scenario.to_dict()
    if digests != known:
        both = digests.keys() | known.keys()
        wrong = sorted(name for name in both if digests.get(name) != known.get(name))
        raise InputError(
            f"--against: {len(wrong)} of {len(both)} scenarios are not the same "
            f"(first: {wrong[0]}); compare drives with the same bag, --ego and --count"
        )


def compared(
    outcomes: Sequence[Outcome], config: ClosedLoopConfig, earlier: Earlier
) -> Comparison:
    """Compare the outcomes of two planners, scenario by scenario.

    Raises:
        InputError: as `refuse_others`.
    """
    refuse_others({outcome.name: outcome.origin.digest for outcome in outcomes}, config, earlier)
    names = [outcome.name for outcome in outcomes]
    before = earlier.drives.loc[names].reset_index()
    passed = pd.Series([outcome.verdict.passed for outcome in outcomes])
    unit, encounters = units_of(names, [outcome.origin for outcome in outcomes])
    change = figures_of([outcome.verdict for outcome in outcomes]) - before[[*FIGURES]].astype(
        float
    )
    figures = {}
    for name, values in change.dropna(axis=1, how="all").items():
        known = values.notna().to_numpy()
        differences = values.to_numpy()[known]
        largest = float(np.abs(differences).max())
        if largest > 0.0:
            level = 1.0 - (1.0 - CONFIDENCE) / len(FIGURES)
            mean = paired_difference(differences / largest, unit[known], level)
            figures[str(name)] = Interval(*(largest * value for value in astuple(mean)))
    return Comparison(
        planner=earlier.planner,
        difference=paired_difference(
            before.passed.astype(float).to_numpy() - passed.to_numpy(), unit, CONFIDENCE
        ),
        now_fail=tuple(before.name[before.passed & ~passed]),
        now_pass=tuple(before.name[~before.passed & passed]),
        of=len(outcomes),
        encounters=encounters,
        figures=figures,
    )
