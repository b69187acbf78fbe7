# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The cases of a bag for export: scenarios with the lanes of their road and their ego."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenario_gen.bags.recordings.read import (
    ego_of,
    INFO,
    Namespace,
    read_recording,
    ScenarioEntry,
    SCENARIOS,
)
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.types import join_ego, Road, Scenario, split_off

TOPICS = ("tracks", "map", "road/lanes", "fit/info", SCENARIOS, INFO)


@dataclass(frozen=True, eq=False)
class Exported:
    """One scenario to be exported.

    Attributes:
        index: index in `scenarios/info`, otherwise its position in the bag.
        seed: seed of its request.
        sha256: SHA-256 of its message in the bag.
        others: the vehicles around the ego, and their trailers; all vehicles without an ego.
        ego: the ego's track, a scenario of one vehicle with the same first instant.
    """

    index: int
    seed: int
    sha256: str
    others: Scenario
    ego: Scenario | None

    @property
    def everybody(self) -> Scenario:
        """All vehicles, the ego last."""
        return join_ego(replace(self.others, reference_drive=self.ego))

    @property
    def duration(self) -> float:
        """The duration [s] until the last vehicle or the ego reaches its end."""
        return float(self.everybody.time[-1])

    def refuse_late_ego(self) -> None:
        """Refuse an ego that arrives late: a planner under test starts at the first instant.

        Raises:
            RefusedError: the ego arrives late.
        """
        if self.ego is not None and self.ego.present[0, 0] > 0:
            begin = float(self.ego.time[self.ego.present[0, 0]])
            raise RefusedError(
                f"scenario {self.index}: the ego, vehicle {self.ego.vehicles[0].id}, arrives "
                f"{begin:.1f} s late, but a planner under test starts at 0 s; use --ego with a "
                "vehicle that is present from the start"
            )


@dataclass(frozen=True, eq=False)
class Case:
    """The scenarios of one template on one road.

    Attributes:
        number: number of the case in the bag, from 1.
        namespace: namespace in the bag; "" is the root.
        road_name: name of the road, for people.
        start_ns: stamp of the template [ns].
        scenarios: the requested scenarios.
        lane_map: the lanes of the road; they do not depend on the requested scenarios.
    """

    number: int
    namespace: str
    road_name: str
    start_ns: int
    scenarios: tuple[Exported, ...]
    lane_map: LaneMap


def evenly_sampled(scenario: Scenario, step: float) -> Scenario:
    """Return a scenario with a constant time step: itself, or sampled every `step` [s]."""
    if np.ptp(np.diff(scenario.time)) <= 1e-9:  # equal but for rounding
        return scenario
    return scenario.resampled(step)


def scenario_source(case: Case, exported: Exported) -> str:
    """Return the source of an exported scenario: index, namespace and hash."""
    return f"scenario {exported.index} of {case.namespace or '/'}, sha256 {exported.sha256}"


@dataclass(frozen=True, eq=False)
class _Group:
    """Scenarios of one namespace, template and road."""

    stamp: int
    entry: ScenarioEntry | None
    scenarios: list[Exported]


def read_cases(
    bag: Path,
    export: ExportConfig = ExportConfig(),
    config: BagConfig = BagConfig(),
    *,
    namespace: str | None = None,
    indices: Collection[int] = (),
) -> tuple[Case, ...]:
    """Return the cases of any bag with the conventions of this suite.

    Args:
        bag: folder of the bag.
        export: ego and lanes.
        config: limits on the size of the bag.
        namespace: read only this namespace.
        indices: read only scenarios with these indices in `scenarios/info`; empty: all.

    Raises:
        InputError: the bag cannot be read, has none of the requested scenarios, or no vehicle with
            the id of the ego.
    """
    spaces = _spaces(bag, config, namespace)
    with naming_bag(bag):
        groups = [(space, group) for space in spaces for group in _groups(space, export)]
        cases = [
            _case(k, space, group, export, indices) for k, (space, group) in enumerate(groups, 1)
        ]
    cases = [case for case in cases if case.scenarios]
    if not cases:
        known = sorted({entry.index for _, group in groups for entry in group.scenarios})
        raise InputError(
            f"{bag}: no scenario {', '.join(map(str, sorted(indices)))}; it has {known[0]} to "
            f"{known[-1]}"
        )
    return tuple(cases)


def _spaces(bag: Path, config: BagConfig, namespace: str | None) -> list[Namespace]:
    """Return the namespaces of a bag that have scenarios, or only the requested one.

    Raises:
        InputError: there is none, or the bag cannot be read.
    """
    namespaces = read_recording(bag, config, TOPICS).namespaces
    spaces = [entry for entry in namespaces.values() if SCENARIOS in entry.messages]
    if not spaces:
        raise InputError(
            f"{bag}: no topic `{SCENARIOS}` in any namespace, so there is nothing to export"
        )
    if namespace is not None:
        full_name = namespace if not namespace or namespace.startswith("/") else f"/{namespace}"
        spaces = [entry for entry in spaces if entry.name == full_name]
        if not spaces:
            raise InputError(
                f"{bag}: no scenarios in namespace {namespace!r}; its namespaces: "
                f"{', '.join(name or '/' for name in namespaces)}"
            )
    return spaces


def _groups(space: Namespace, export: ExportConfig) -> Iterator[_Group]:
    """Yield the scenarios of a namespace by template and road."""
    space.check_infos()
    groups: dict[tuple[object, ...], _Group] = {}
    for k, sha256 in enumerate(space.hashes):
        entry = space.entry(k)
        stamp, scenario = space.scenario(k)
        key = (stamp, entry and entry.template_hash, entry and entry.map_hash)
        group = groups.setdefault(key, _Group(stamp, entry, []))
        others, ego = _with_ego(space, entry, scenario, export.ego)
        group.scenarios.append(Exported(scenario.index, scenario.seed, sha256, others, ego))
    yield from groups.values()


def _with_ego(
    space: Namespace, entry: ScenarioEntry | None, scenario: Scenario, requested: str
) -> tuple[Scenario, Scenario | None]:
    """Return the vehicles around the ego, and its track.

    Raises:
        InputError: as `ego_of`, or the requested ego is the only vehicle.
    """
    if scenario.reference_drive is None and not (requested or (entry and entry.ego)):
        return scenario, None
    where = f"{space.where(SCENARIOS)}, scenario {scenario.index}"
    ego = ego_of(scenario, entry, requested, where)
    if scenario.reference_drive is not None:
        return replace(scenario, reference_drive=None), scenario.reference_drive
    if len(scenario.ids) == 1:
        raise InputError(f"{where} has only vehicle {ego!r}, so there would be none around it")
    return split_off(scenario, scenario.ids.index(ego))


def _case(
    number: int, space: Namespace, group: _Group, export: ExportConfig, indices: Collection[int]
) -> Case:
    """Return a case with its lanes.

    Raises:
        InputError: its tracks or its map are damaged.
    """
    road: Road | None = space.road_of(group.entry, group.stamp)
    if road is None and space.data("map"):
        road = space.road
    name = group.entry.road if group.entry else ""
    return Case(
        number=number,
        namespace=space.name,
        road_name=name or "road",
        start_ns=group.stamp,
        scenarios=tuple(
            replace(exported, others=exported.others.with_trailers())
            for exported in group.scenarios
            if not indices or exported.index in indices
        ),
        lane_map=LaneMap.of(road, export.run_out),
    )
