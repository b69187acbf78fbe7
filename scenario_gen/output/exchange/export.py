# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenario-gen export`: a folder of files for other software, with notes on them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
import json
from pathlib import Path
from typing import Any

import numpy as np
from shapely import contains_xy, prepare

from scenario_gen.bags.recordings.autoware import add_autoware
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.folders import Kind, replaced_folder, sha256_of, write_text
from scenario_gen.base.registry import Registry
from scenario_gen.output.exchange.cases import Case, Exported, read_cases
from scenario_gen.output.exchange.commonroad import benchmark_id, write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.derived_lanes import area_of
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.openscenario import write_openscenario
from scenario_gen.output.exchange.osi import write_osi
from scenario_gen.output.exchange.projection import projection_of
from scenario_gen.output.exchange.scenarionet import dataset_files, description, file_name, pickled
from scenario_gen.roads import read_network

EXPORTED = Kind("exported")
MANIFEST = "export.json"
MAPS = (
    ".xodr",
    ".osm",
)  # endings of the names of maps that OpenSCENARIO can name: OpenDRIVE, Lanelet2
ON_LANES = 0.9  # share of positions that lie on lanes of the map on which they were made, at least


@dataclass(frozen=True)
class Export:
    """What was written: the number of scenarios, and sentences on lanes, changes and what was left out."""

    scenarios: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Written:
    """Names of the files of one scenario, in the folder of the export, with notes on it, and what `closing` is to know of it."""

    names: tuple[str, ...]
    notes: tuple[str, ...] = ()
    content: Any = None


@dataclass(frozen=True)
class ExportFormat:
    """A format of other software. The same case must give the same bytes.

    Attributes:
        write: writes one scenario of a case into the folder; it raises RefusedError for what the format cannot hold.
        shared: files that all scenarios of a case have in common, by name.
        closing: files about all scenarios, by name: of the first file and the `content` of each.
        takes_map: whether `ExportConfig.map` is written in place of lanes.
        maps: endings of the names of such maps.
        projected_from: latitude and longitude about which positions are, if they are to be projected as a map is; else ().
    """

    write: Callable[[Path, Case, Exported, ExportConfig], Written]
    shared: Callable[[Case, ExportConfig], Mapping[str, bytes]] = lambda *_: {}
    projected_from: Callable[[Case, ExportConfig], tuple[float, ...]] = lambda *_: ()
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
    """Write the scenarios of a bag to a folder, in another format: the same bytes for the same bag.

    Args:
        bag: of this suite's conventions.
        out: the folder; an earlier export there is replaced.
        target: a name in `EXPORTS`.
        export: ego, lanes, time windows.
        config: what is read of the bag at most.
        namespace: only this one.
        indices: only scenarios of these, as in `scenarios/info`.
        progress: called with the number of scenarios written, and of all.

    Raises:
        InputError: the bag cannot be read, or not what is asked for of it; `out` may not be replaced.
        RefusedError: no scenario can be written in that format.
    """
    to = _format(target, export.map)
    cases = read_cases(bag, export, config, namespace=namespace, indices=indices)
    notes: list[str] = []
    entries: list[dict[str, object]] = []
    contents: list[tuple[str, Any]] = []
    done, total = count(), sum(len(case.scenarios) for case in cases)
    with replaced_folder(out, EXPORTED, [bag]) as folder:
        for case in cases:
            about = f"case {case.number}, {case.road_name}{f' in {case.namespace}' if case.namespace else ''}"
            frame, moved = projection_of(to.projected_from(case, export), export)
            said = "; ".join(filter(None, (_origin(case, export), frame)))
            notes.append(f"{about}: {len(case.scenarios)} scenarios; {said}")
            for name, data in to.shared(case, export).items():
                (folder / name).write_bytes(data)
            for exported in case.scenarios:
                progress(next(done), total)
                try:
                    ego = None if exported.ego is None else moved(exported.ego)
                    placed = replace(exported, others=moved(exported.others), ego=ego)
                    written = to.write(folder, case, placed, export)
                except RefusedError as error:
                    notes.append(f"{about}: left out: {error}")
                    continue
                notes += [
                    f"{about}, scenario {exported.index}: {sentence}" for sentence in written.notes
                ]
                entries.append(_entry(case, exported, written.names, export))
                contents.append((written.names[0], written.content))
        if not entries:
            raise RefusedError("nothing could be exported:\n" + "\n".join(notes))
        for name, data in to.closing(contents).items():
            (folder / name).write_bytes(data)
        digests = {
            str(p.relative_to(folder)): sha256_of(p)
            for p in sorted(folder.rglob("*"))
            if p.is_file()
        }
        document = {"format": target, "notes": notes, "scenarios": entries, "sha256": digests}
        write_text(folder / MANIFEST, json.dumps(document, indent=2) + "\n")
    return Export(len(entries), tuple(notes))


def _format(target: str, road: str) -> ExportFormat:
    """Return a format of `EXPORTS`, if it takes the map that is given ("": none).

    Raises:
        InputError: it does not.
    """
    to = EXPORTS[target]
    if road and not to.takes_map:
        raise InputError(
            f"map: --to {target} writes lanes of its own; a map can be given with --to openscenario or osi"
        )
    if road and Path(road).suffix.lower() not in to.maps:
        known = "OpenDRIVE (.xodr)" + (" or Lanelet2 (.osm)" if ".osm" in to.maps else "")
        raise InputError(f"map {road}: --to {target} takes a road of {known}")
    return to


def _origin(case: Case, export: ExportConfig) -> str:
    if export.map:
        notes = map(str, read_network(Path(export.map)).notes)
        return "; ".join((f"the lanes of {Path(export.map).name}", *notes))
    return case.lane_map.origin


def _entry(
    case: Case, exported: Exported, names: tuple[str, ...], export: ExportConfig
) -> dict[str, object]:
    """Return what the manifest says of a scenario; obstacles and entities of a file are in the order of `vehicles`."""
    return {
        "files": list(names),
        "namespace": case.namespace,
        "road": case.road_name,
        "lanes": "derived" if case.lane_map.derived and not export.map else "true",
        "index": exported.index,
        "seed": exported.seed,
        "sha256": exported.sha256,
        "vehicles": [vehicle.id for vehicle in exported.others.vehicles],
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


def _to_osi(folder: Path, case: Case, exported: Exported, export: ExportConfig) -> Written:
    road, name = _road_file(case, export), f"case_{case.number}_{exported.index}.mcap"
    return Written((name, road), write_osi(folder / name, case, exported, folder / road))


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
    """Refuse a map that is not the one on which the scenarios of a case drive.

    Raises:
        InputError: it cannot be read, or more than a tenth of the positions lie on none of its lanes.
    """
    lanes = area_of(read_network(path).whole)
    prepare(lanes)
    places = np.concatenate([one.others.position[one.others.is_present] for one in case.scenarios])
    share = float(contains_xy(lanes, places).mean())
    if share < ON_LANES:
        raise InputError(
            f"map {path}: {100.0 * share:.0f} % of the positions of {case.road_name} lie on its lanes; name the map that the "
            "scenarios were made on"
        )


EXPORTS = Registry[ExportFormat](
    "scenario_gen.exports",
    {
        "commonroad": ExportFormat(_to_commonroad),
        "openscenario": ExportFormat(_to_openscenario, _roads, _origin_of_map, takes_map=True),
        "osi": ExportFormat(_to_osi, _roads, takes_map=True, maps=(".xodr",)),
        "autoware": ExportFormat(_to_autoware, projected_from=lambda case, _: case.origin),
        "scenarionet": ExportFormat(_to_scenarionet, closing=dataset_files),
    },
    ExportFormat,
)
"""The formats by name."""
