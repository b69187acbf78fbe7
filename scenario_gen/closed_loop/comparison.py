# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The difference of failures of two planners, or two versions, on the same scenarios."""

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
        drives: by name of the scenario its digest, and whether the planner passed.
    """

    planner: str
    parameters: dict[str, Any]
    drives: dict[str, tuple[str, bool]]


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
    """

    planner: str
    difference: Interval
    now_fail: tuple[str, ...]
    now_pass: tuple[str, ...]
    of: int
    encounters: int

    @property
    def worse(self) -> bool:
        """Whether the planner fails significantly more often than the earlier one."""
        return self.difference.low > 0.0

    def sentence(self) -> str:
        """Return the comparison in words."""
        share = self.difference
        interval = f"{100.0 * share.low:+.1f} to {100.0 * share.high:+.1f}"
        return (
            f"against {self.planner}: failures {100.0 * share.value:+.1f} % ({interval}) on the "
            f"same {self.of} scenarios; "
            f"{len(self.now_fail)} now fail, {len(self.now_pass)} now pass"
        )

    def document(self) -> dict[str, Any]:
        """Return the comparison as JSON's types."""
        share = self.difference
        return {
            "planner": self.planner,
            "difference": {"value": share.value, "low": share.low, "high": share.high},
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
    drives = {drive["name"]: (drive["scenario"], drive["passed"]) for drive in document["drives"]}
    return Earlier(document["planner"], document["parameters"], drives)


def refuse_others(digests: Mapping[str, str], config: ClosedLoopConfig, earlier: Earlier) -> None:
    """Check that earlier drives have the same scenarios (`digests` by name) and parameters.

    Raises:
        InputError: they differ; the message names the first scenario, or the parameters.
    """
    parameters = {name: value for name, (_, value) in flatten(config).items()}
    names = (parameters.keys() | earlier.parameters.keys()) - UNCOMPARED
    differ = sorted(name for name in names if parameters.get(name) != earlier.parameters.get(name))
    if differ:
        raise InputError(
            f"--against: driven with other parameters ({', '.join(differ)}); "
            "use the same ones, or drive the earlier planner again"
        )
    known = {name: digest for name, (digest, _) in earlier.drives.items()}
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
    before = [not earlier.drives[outcome.name][1] for outcome in outcomes]
    now = [not outcome.verdict.passed for outcome in outcomes]
    difference = np.array(now, dtype=np.float64) - np.array(before, dtype=np.float64)
    names = np.array([outcome.name for outcome in outcomes])
    unit, encounters = units_of(names.tolist(), [outcome.origin for outcome in outcomes])
    return Comparison(
        planner=earlier.planner,
        difference=paired_difference(difference, unit, CONFIDENCE),
        now_fail=tuple(names[difference > 0.0].tolist()),
        now_pass=tuple(names[difference < 0.0].tolist()),
        of=len(outcomes),
        encounters=encounters,
    )
