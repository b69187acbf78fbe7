# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenario-gen export`: a folder of files for other software, with notes on them."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import count
import json
from pathlib import Path

from scenario_gen.bags.recordings.autoware import add_autoware
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.folders import Kind, replaced_folder, sha256_of, write_text
from scenario_gen.base.registry import Registry
from scenario_gen.output.exchange.cases import Case, Exported, read_cases
from scenario_gen.output.exchange.commonroad import benchmark_id, write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.openscenario import write_openscenario

EXPORTED = Kind("exported")
MANIFEST = "export.json"


@dataclass(frozen=True)
class Export:
    """What was written: the number of scenarios, and sentences on lanes, changes and what was left out."""

    scenarios: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Written:
    """Names of the files of one scenario, in the folder of the export, with notes on it."""

    names: tuple[str, ...]
    notes: tuple[str, ...] = ()


def _nothing_shared(_: Case) -> Mapping[str, bytes]:
    return {}


@dataclass(frozen=True)
class ExportFormat:
    """A format of other software. The same case must give the same bytes.

    Attributes:
        write: writes one scenario of a case into the folder; it raises RefusedError for what the format cannot hold.
        shared: files that all scenarios of a case have in common, by name.
        own_lanes: whether the lanes of a vector map are written; if not, ones derived from the scenarios are in their place.
    """

    write: Callable[[Path, Case, Exported, ExportConfig], Written]
    shared: Callable[[Case], Mapping[str, bytes]] = _nothing_shared
    own_lanes: bool = False


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
    to = EXPORTS[target]
    cases = read_cases(bag, export, config, namespace=namespace, indices=indices)
    notes: list[str] = []
    entries: list[dict[str, object]] = []
    done, total = count(), sum(len(case.scenarios) for case in cases)
    with replaced_folder(out, EXPORTED, [bag]) as folder:
        for case in cases:
            about = f"case {case.number}, {case.road_name}{f' in {case.namespace}' if case.namespace else ''}"
            notes.append(f"{about}: {len(case.scenarios)} scenarios; {_origin(case, to)}")
            for name, data in to.shared(case).items():
                (folder / name).write_bytes(data)
            for exported in case.scenarios:
                progress(next(done), total)
                try:
                    message = to.write(folder, case, exported, export)
                except RefusedError as error:
                    notes.append(f"{about}: left out: {error}")
                    continue
                notes += [f"{about}, scenario {exported.index}: {sentence}" for sentence in message.notes]
                entries.append(_entry(case, exported, message.names, to))
        if not entries:
            raise RefusedError("nothing could be exported:\n" + "\n".join(notes))
        digests = {str(p.relative_to(folder)): sha256_of(p) for p in sorted(folder.rglob("*")) if p.is_file()}
        document = {"format": target, "notes": notes, "scenarios": entries, "sha256": digests}
        write_text(folder / MANIFEST, json.dumps(document, indent=2) + "\n")
    return Export(len(entries), tuple(notes))


def _has_own_lanes(case: Case, to: ExportFormat) -> bool:
    """Say whether the lanes of a vector map are written."""
    return to.own_lanes and bool(case.lane_map.network)


def _origin(case: Case, to: ExportFormat) -> str:
    return case.lane_map.network_origin if _has_own_lanes(case, to) else case.lane_map.origin


def _entry(case: Case, exported: Exported, names: tuple[str, ...], to: ExportFormat) -> dict[str, object]:
    """Return what the manifest says of a scenario; obstacles and entities of a file are in the order of `vehicles`."""
    return {
        "files": list(names),
        "namespace": case.namespace,
        "road": case.road_name,
        "lanes": "derived" if case.lane_map.derived and not _has_own_lanes(case, to) else "true",
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


def _road_file(case: Case) -> str:
    return f"case_{case.number}.xodr"


def _to_openscenario(folder: Path, case: Case, exported: Exported, export: ExportConfig) -> Written:
    name = f"case_{case.number}_{exported.index}.xosc"
    (folder / name).write_bytes(write_openscenario(case, exported, _road_file(case), export))
    return Written((name, _road_file(case)))


def _to_autoware(folder: Path, case: Case, exported: Exported, _: ExportConfig) -> Written:
    name = f"case_{case.number}_{exported.index}"
    with BagWriter(folder / name) as bag:
        add_autoware(bag, exported.others, exported.ego, case.start_ns)
    notes = () if exported.ego is not None else ("there is no ego, so no /localization/kinematic_state; name one with --ego",)
    return Written((name,), notes)


def _roads(case: Case) -> Mapping[str, bytes]:
    return {_road_file(case): write_opendrive(case.lane_map, case.road_name, case.start_ns)}


EXPORTS = Registry[ExportFormat](
    "scenario_gen.exports",
    {
        "commonroad": ExportFormat(_to_commonroad, own_lanes=True),
        "openscenario": ExportFormat(_to_openscenario, _roads),
        "autoware": ExportFormat(_to_autoware),
    },
    ExportFormat,
)
"""The formats by name."""
