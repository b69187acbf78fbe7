# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenario-gen export`: a folder of files for other software, with notes on them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from shapely import contains_xy, prepare

from scenario_gen.bags.recordings.autoware import add_autoware
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.folders import (
    Kind,
    replaced_folder,
    sha256_of,
    write_text,
)
from scenario_gen.base.registry import Registry
from scenario_gen.base.removed import refuse_removed
from scenario_gen.numerics import Floats
from scenario_gen.output.exchange.cases import Case, Exported, read_cases
from scenario_gen.output.exchange.commonroad import benchmark_id, write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.openscenario import write_openscenario
from scenario_gen.output.exchange.projection import projection_of
from scenario_gen.output.exchange.scenarionet import dataset_files, description, file_name, pickled
from scenario_gen.output.table import TABLES
from scenario_gen.roads import read_network
from scenario_gen.types import Scenario

EXPORTED = Kind("exported")
MANIFEST = "export.json"
MAPS = (".xodr", ".osm")  # suffixes of maps that OpenSCENARIO can reference
MIN_ON_LANES_SHARE = 0.9  # of positions, on the lanes of the map of the scenarios


@dataclass(frozen=True)
class Export:
    """The number of exported scenarios, and notes on lanes, changes and omissions."""

    scenarios: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Written:
    """The files of one exported scenario, notes on it, and its content for `closing`."""

    names: tuple[str, ...]
    notes: tuple[str, ...] = ()
    content: Any = None


@dataclass(frozen=True)
class ExportFormat:
    """A format of other software. The same case must give the same bytes.

    Attributes:
        write: writes one scenario of a case into the folder; raises RefusedError if the format
            cannot represent it.
        shared: returns the files that all scenarios of a case share, by name.
        closing: returns the files about all scenarios, by name, from the first file and the
            `content` of each scenario.
        needs_lanes: whether a road without lanes is refused.
        takes_map: whether `ExportConfig.map` can replace the lanes.
        maps: suffixes of such maps.
        projected_from: returns the latitude and longitude of the origin if positions need a
            projection, else ().
    """

    write: Callable[[Path, Case, Exported, ExportConfig], Written]
    shared: Callable[[Case, ExportConfig], Mapping[str, bytes]] = lambda *_: {}
    projected_from: Callable[[Case, ExportConfig], tuple[float, ...]] = lambda *_: ()
    needs_lanes: bool = False
    takes_map: bool = False
    maps: tuple[str, ...] = MAPS
    closing: Callable[[Sequence[tuple[str, Any]]], Mapping[str, bytes]] = lambda _: {}


def export_bag(
    bag: Path,
    out: Path,
    target: str,
    export: ExportConfig = ExportConfig(),
    config: BagConfig = BagConfig(),
    *,
    namespace: str | None = None,
    indices: Collection[int] = (),
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Export:
    """Write the scenarios of a bag to a folder in another format.

    The same bag gives the same bytes.

    Args:
        bag: a bag with the conventions of this suite.
        out: the folder; an earlier export in it is replaced.
        target: a name in `EXPORTS`.
        export: ego, lanes, time windows.
        config: limits on the size of the bag.
        namespace: export only this namespace.
        indices: export only scenarios with these indices in `scenarios/info`.
        progress: called with the number of exported scenarios and their total.

    Raises:
        InputError: the bag or a requested part of it cannot be read, or `out` must not be
            replaced.
        RefusedError: no scenario can be written in that format.
    """
    to = _format(target, export.map)
    cases = read_cases(bag, export, config, namespace=namespace, indices=indices)
    total = sum(len(case.scenarios) for case in cases)
    with replaced_folder(out, EXPORTED, [bag]) as folder:
        exporting = _Exporting(folder, to, export, lambda done: progress(done, total))
        for case in cases:
            exporting.add_case(case)
        notes, entries = exporting.notes, exporting.entries
        if not entries:
            raise RefusedError("nothing could be exported:", *notes)
        for name, data in to.closing(exporting.contents).items():
            (folder / name).write_bytes(data)
        digests = {
            str(p.relative_to(folder)): sha256_of(p)
            for p in sorted(folder.rglob("*"))
            if p.is_file()
        }
        document = {"format": target, "notes": notes, "scenarios": entries, "sha256": digests}
        write_text(folder / MANIFEST, json.dumps(document, indent=2) + "\n")
    return Export(len(entries), tuple(notes))


@dataclass(eq=False)
class _Exporting:
    """An export in progress: notes, entries of the manifest, and contents for `closing`."""

    folder: Path
    to: ExportFormat
    export: ExportConfig
    progress: Callable[[int], None]
    done: int = 0
    notes: list[str] = field(default_factory=list)
    entries: list[dict[str, object]] = field(default_factory=list)
    contents: list[tuple[str, Any]] = field(default_factory=list)

    def add_case(self, case: Case) -> None:
        """Write the shared files and the scenarios of a case."""
        place = f" in {case.namespace}" if case.namespace else ""
        title = f"case {case.number}, {case.road_name}{place}"
        frame, moved = projection_of(self.to.projected_from(case, self.export), self.export)
        origins = "; ".join(filter(None, (_origin(case, self.export), frame)))
        if self.to.needs_lanes and not (case.lane_map.network.lanes or self.export.map):
            self.notes.append(f"{title}: left out: {origins}; autoware, csv and parquet need none")
            return
        self.notes.append(f"{title}: {len(case.scenarios)} scenarios; {origins}")
        for name, data in self.to.shared(case, self.export).items():
            (self.folder / name).write_bytes(data)
        for exported in case.scenarios:
            self.progress(self.done)
            self.done += 1
            self._add_scenario(title, case, exported, moved)

    def _add_scenario(
        self,
        title: str,
        case: Case,
        exported: Exported,
        moved: Callable[[Scenario], Scenario],
    ) -> None:
        """Write one scenario, moved into the frame of the export; note why it was refused."""
        try:
            ego = None if exported.ego is None else moved(exported.ego)
            placed = replace(exported, others=moved(exported.others), ego=ego)
            written = self.to.write(self.folder, case, placed, self.export)
        except RefusedError as error:
            self.notes.append(f"{title}: left out: {error}")
            return
        self.notes += [f"{title}, scenario {exported.index}: {note}" for note in written.notes]
        self.entries.append(_entry(case, exported, written.names, self.export))
        self.contents.append((written.names[0], written.content))


def _format(target: str, road: str) -> ExportFormat:
    """Return a format of `EXPORTS`; `road` is a map, or "".

    Raises:
        InputError: the format was removed, is not known, or does not support this map.
    """
    refuse_removed(f"--to {target}")
    to = EXPORTS[target]
    if road and not to.takes_map:
        raise InputError(
            f"map: --to {target} writes lanes of its own; a map can be given with --to "
            "openscenario"
        )
    if road and Path(road).suffix.lower() not in to.maps:
        known = "OpenDRIVE (.xodr)" + (" or Lanelet2 (.osm)" if ".osm" in to.maps else "")
        raise InputError(f"map {road}: --to {target} needs a map in {known}")
    return to


def _origin(case: Case, export: ExportConfig) -> str:
    if export.map:
        notes = map(str, read_network(Path(export.map)).notes)
        return "; ".join((f"the lanes of {Path(export.map).name}", *notes))
    return case.lane_map.origin


def _entry(
    case: Case, exported: Exported, names: tuple[str, ...], export: ExportConfig
) -> dict[str, object]:
    """Return the manifest's entry of a scenario; `vehicles` has the order of the file."""
    return {
        "files": list(names),
        "namespace": case.namespace,
        "road": case.road_name,
        "index": exported.index,
        "seed": exported.seed,
        "sha256": exported.sha256,
        "vehicles": exported.others.ids,
        "ego": None if exported.ego is None else exported.ego.vehicles[0].id,
    }


def _to_commonroad(folder: Path, case: Case, exported: Exported, export: ExportConfig) -> Written:
    data, notes = write_commonroad(case, exported, export)
    name = f"{benchmark_id(case, exported)}.xml"
    (folder / name).write_bytes(data)
    return Written((name,), notes)


def _road_file(case: Case, export: ExportConfig) -> str:
    return Path(export.map).name if export.map else f"case_{case.number}.xodr"


def _to_openscenario(
    folder: Path, case: Case, exported: Exported, export: ExportConfig
) -> Written:
    name = f"case_{case.number}_{exported.index}.xosc"
    (folder / name).write_bytes(
        write_openscenario(case, exported, _road_file(case, export), export)
    )
    return Written((name, _road_file(case, export)))


def _to_autoware(folder: Path, case: Case, exported: Exported, _: ExportConfig) -> Written:
    name = f"case_{case.number}_{exported.index}"
    with BagWriter(folder / name) as bag:
        add_autoware(bag, exported.others, exported.ego, case.start_ns)
    notes = (
        ()
        if exported.ego is not None
        else ("there is no ego, so no /localization/kinematic_state; name one with --ego",)
    )
    return Written((name,), notes)


def _to_scenarionet(folder: Path, case: Case, exported: Exported, export: ExportConfig) -> Written:
    described = description(case, exported, export)
    name = file_name(case, exported)
    (folder / name).write_bytes(pickled(described))
    return Written((name,), content={"metadata": described["metadata"]})


def _to_table(suffix: str) -> ExportFormat:
    """Return the format of one table for all scenarios, whose columns name case and scenario."""

    def write(_: Path, case: Case, exported: Exported, __: ExportConfig) -> Written:
        table = exported.everybody.to_dataframe()
        table.insert(0, "case", case.number)
        table["scenario"] = exported.index
        return Written((f"scenarios.{suffix}",), content=table)

    def closing(contents: Sequence[tuple[str, Any]]) -> Mapping[str, bytes]:
        tables = [table for _, table in contents]
        return {contents[0][0]: TABLES[suffix](pd.concat(tables, ignore_index=True))}

    return ExportFormat(write, closing=closing)


def _roads(case: Case, export: ExportConfig) -> Mapping[str, bytes]:
    if export.map:
        refuse_other_map(case, Path(export.map))
        return {_road_file(case, export): Path(export.map).read_bytes()}
    return {
        _road_file(case, export): write_opendrive(case.lane_map, case.road_name, case.start_ns)
    }


def _origin_of_map(_: Case, export: ExportConfig) -> tuple[float, ...]:
    return read_network(Path(export.map)).origin if export.map else ()


def refuse_other_map(case: Case, path: Path) -> None:
    """Refuse a map that is not the map of a case.

    Raises:
        InputError: the map cannot be read, or too few positions lie on its lanes.
    """
    lanes = LaneMap(read_network(path).whole, path.name).area
    prepare(lanes)
    places = np.concatenate([_positions(exported.others) for exported in case.scenarios])
    share = float(contains_xy(lanes, places).mean())
    if share < MIN_ON_LANES_SHARE:
        raise InputError(
            f"map {path}: {100.0 * share:.0f} % of the positions of {case.road_name} lie on its "
            "lanes; name the map that the scenarios were made on"
        )


def _positions(scenario: Scenario) -> Floats:
    """Return the positions (P, 2) [m] of all vehicles while they are present."""
    return scenario.position[scenario.is_present]


EXPORTS = Registry[ExportFormat](
    "scenario_gen.exports",
    {
        "commonroad": ExportFormat(_to_commonroad, needs_lanes=True),
        "openscenario": ExportFormat(
            _to_openscenario, _roads, _origin_of_map, needs_lanes=True, takes_map=True
        ),
        "autoware": ExportFormat(
            _to_autoware, projected_from=lambda case, _: case.lane_map.network.origin
        ),
        "scenarionet": ExportFormat(_to_scenarionet, closing=dataset_files, needs_lanes=True),
        **{suffix: _to_table(suffix) for suffix in TABLES},
    },
    ExportFormat,
)
"""The formats by name."""
