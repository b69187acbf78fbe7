# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two planners, or two versions of one, on the same scenarios: the difference of their failures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.documents import parse_json, read_text
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import units_of
from scenario_gen.closed_loop.trials import LEVEL, Outcome
from scenario_gen.method.evaluation import paired_difference
from scenario_gen.types import Interval

LONGEST = 64 * 1024 * 1024  # bytes of a drives.json; a drive takes 2 kB
_DRIVE = {
    "type": "object",
    "properties": {
        "name": {"type": "string"},
        "scenario": {"type": "string"},
        "passed": {"type": "boolean"},
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
OF_THE_MACHINE = {"decision_time", "drive_time"}  # parameters that change no verdict


@dataclass(frozen=True)
class Earlier:
    """What a drives.json has of another planner: its name, parameters, and by scenario the digest and whether it passed."""

    planner: str
    parameters: dict[str, Any]
    drives: dict[str, tuple[str, bool]]


@dataclass(frozen=True)
class Comparison:
    """A planner beside an earlier one.

    Attributes:
        planner: the earlier one.
        difference: share of failures less that of the earlier one, with its 95 % interval; above 0
            is worse.
        now_fail, now_pass: names of the scenarios that changed sides.
        of: scenarios.
        encounters: that they are of.
    """

    planner: str
    difference: Interval
    now_fail: tuple[str, ...]
    now_pass: tuple[str, ...]
    of: int
    encounters: int

    @property
    def worse(self) -> bool:
        """Whether it fails more often than the earlier one by more than chance explains."""
        return self.difference.low > 0.0

    def sentence(self) -> str:
        """Say it in words."""
        value, low, high = (
            f"{100.0 * x:+.1f}"
            for x in (self.difference.value, self.difference.low, self.difference.high)
        )
        changed = f"{len(self.now_fail)} now fail, {len(self.now_pass)} now pass"
        return f"against {self.planner}: failures {value} % ({low} to {high}) on the same {self.of} scenarios; {changed}"

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        share = self.difference
        return {
            "planner": self.planner,
            "difference": {"value": share.value, "low": share.low, "high": share.high},
            "now_fail": list(self.now_fail),
            "now_pass": list(self.now_pass),
            "worse": self.worse,
        }


def read_drives(path: Path) -> Earlier:
    """Read a drives.json, or that of a folder.

    Raises:
        InputError: it is not there, or is none, or an older one without digests.
    """
    file = path / "drives.json" if path.is_dir() else path
    what = f"--against {file} (give a drives.json of `scenario-gen drive`)"
    document = parse_json(read_text(file, LONGEST, what), what, DRIVES)
    drives = {drive["name"]: (drive["scenario"], drive["passed"]) for drive in document["drives"]}
    return Earlier(document["planner"], document["parameters"], drives)


def refuse_others(digests: Mapping[str, str], config: ClosedLoopConfig, earlier: Earlier) -> None:
    """Refuse to compare with drives of other scenarios (`digests` by name), or with other parameters.

    Raises:
        InputError: they are; the message names the first.
    """
    own = {name: value for name, (_, value) in flatten(config).items()}
    names = (own.keys() | earlier.parameters.keys()) - OF_THE_MACHINE
    differ = sorted(name for name in names if own.get(name) != earlier.parameters.get(name))
    if differ:
        raise InputError(
            f"--against: driven with other parameters ({', '.join(differ)}); give the same, or drive it again"
        )
    known = {name: digest for name, (digest, _) in earlier.drives.items()}
    if digests != known:
        both = digests.keys() | known.keys()
        wrong = sorted(name for name in both if digests.get(name) != known.get(name))
        raise InputError(
            f"--against: {len(wrong)} of {len(both)} scenarios are not the same (first: {wrong[0]}); compare drives of "
            "the same bag, ego and --count"
        )


def compared(
    outcomes: Sequence[Outcome], config: ClosedLoopConfig, earlier: Earlier
) -> Comparison:
    """Compare the outcomes of a planner with those of an earlier one, scenario by scenario.

    Raises:
        InputError: as `refuse_others`.
    """
    refuse_others({outcome.name: outcome.origin.digest for outcome in outcomes}, config, earlier)
    before = [not earlier.drives[outcome.name][1] for outcome in outcomes]
    now = [not outcome.verdict.passed for outcome in outcomes]
    difference = np.array(now, dtype=np.float64) - np.array(before, dtype=np.float64)
    unit, encounters = units_of(
        [outcome.name for outcome in outcomes], [outcome.origin for outcome in outcomes]
    )
    sides = [
        tuple(one.name for one, d in zip(outcomes, difference.tolist(), strict=True) if d == side)
        for side in (1.0, -1.0)
    ]
    return Comparison(
        earlier.planner,
        paired_difference(difference, unit, LEVEL),
        sides[0],
        sides[1],
        len(outcomes),
        encounters,
    )
