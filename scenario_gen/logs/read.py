# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From a log to encounters: read, clean, smooth, group, cut (paper II-A)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, overload, TYPE_CHECKING

from scenario_gen.base.copies import naming_inputs
from scenario_gen.base.errors import InputError, reading
from scenario_gen.base.folders import scratch
from scenario_gen.base.parameters import updated
from scenario_gen.logs.checks import copies_in, doubts_of_pieces, doubts_of_rows
from scenario_gen.logs.cleaning import clean, Drops, newest_last
from scenario_gen.logs.clock import retimed
from scenario_gen.logs.config import chosen_vehicles, LogConfig
from scenario_gen.logs.encounters import cut_track, Piece, pieces_of, plausible
from scenario_gen.logs.evidence import interpret
from scenario_gen.logs.extract import cut_encounter, encounter_quality, recorded_encounters
from scenario_gen.logs.files import logs_in, read_raw
from scenario_gen.logs.groups import find_groups, vehicles_near
from scenario_gen.logs.kinds import counted, typed
from scenario_gen.logs.no_encounter import (
    explain_few_vehicles,
    explain_no_encounter,
    NoEncounterError,
)
from scenario_gen.logs.quality import check_doubts, Doubt, Quality, VehicleQuality
from scenario_gen.logs.raw import natural, Observations, RawLog
from scenario_gen.logs.signals import lines_where_vehicles_stop, moved_signals, with_lights
from scenario_gen.logs.trailers import coupled
from scenario_gen.types import Encounter
from scenario_gen.types.html import html_list, html_table
from scenario_gen.types.vehicle import Vehicles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

_DATAFRAME_FILE = "dataframe.csv"
_MANY_DROPS_SHARE = 0.02  # of the rows; the user is told at once


@dataclass(frozen=True, repr=False)
class LogResult(Sequence[Encounter]):
    """The encounters of a log by time, as a sequence.

    Attributes:
        encounters: by time.
        quality: of the recording.
        doubts: about reading it.
    """

    encounters: tuple[Encounter, ...]
    quality: Quality
    doubts: tuple[Doubt, ...] = ()

    def __len__(self) -> int:
        """Return the number of encounters."""
        return len(self.encounters)

    @overload
    def __getitem__(self, index: int) -> Encounter: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Encounter, ...]: ...
    def __getitem__(self, index: int | slice) -> Encounter | tuple[Encounter, ...]:
        """Return an encounter, or some of them."""
        return self.encounters[index]

    def __repr__(self) -> str:
        """Return the numbers of encounters, vehicles and doubts in a line."""
        vehicles = {vehicle.id for vehicle in self.quality.vehicles}
        return (
            f"LogResult({len(self)} encounters, {len(vehicles)} vehicles, "
            f"{len(self.doubts)} doubts)"
        )

    @property
    def vehicles(self) -> Vehicles:
        """The vehicles of all encounters, each once."""
        every = {vehicle.id: vehicle for encounter in self for vehicle in encounter.vehicles}
        return Vehicles(every.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """What was dropped, bridged, smoothed and assumed, and the doubts, in sentences."""
        return (*self.quality.lines(), *map(str, self.doubts))

    def summary(self) -> "DataFrame":
        """Return a row for each encounter: its name, kind, vehicles and measures."""
        import pandas as pd

        rows = [
            {"name": each.name, "kind": each.kind, "vehicles": ", ".join(each.ids)}
            | each.measures().drop("scenario").to_dict()
            for each in self
        ]
        return pd.DataFrame(rows)

    def to_dataframe(self) -> "DataFrame":
        """Return the tables of the encounters in one, with a column encounter."""
        import pandas as pd

        tables = [each.to_dataframe().assign(encounter=each.name) for each in self]
        return pd.concat(tables, ignore_index=True)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the paths of all vehicles, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        for encounter in self:
            ax = encounter.plot(ax)
        assert ax is not None  # a log has an encounter
        ax.set_title(repr(self))
        return ax

    def _repr_html_(self) -> str:
        """Return encounters, quality and doubts for a notebook."""
        rows = [
            (
                f"encounters[{k}]",
                encounter.name,
                ", ".join(encounter.ids),
                f"{encounter.duration:.1f} s",
            )
            for k, encounter in enumerate(self.encounters)
        ]
        return html_table(repr(self), rows) + html_list(self.notes)


def read_log(
    path: "Path | str | Sequence[Path | str] | DataFrame",
    config: LogConfig | Mapping[str, Any] = LogConfig(),
    **parameters: Any,
) -> LogResult:
    """Read a log and cut it into encounters.

    Args:
        path: a file, a bag or a folder of files; or several files that share one clock; or a
            DataFrame with the columns of a table.
        config: how to read, clean and cut, or a mapping with parameters of `log`.
        **parameters: single parameters of `log`, e.g. `vehicles="1,2"`.

    Returns:
        At least one encounter, on a common clock in a local east-north frame, and the quality.

    Raises:
        InputError: the log cannot be used; the message names file and row or topic, and a remedy.

    Examples:
        >>> from scenario_gen import read_log
        >>> from scenario_gen.logs import bundled
        >>> encounter = read_log(bundled("a")).encounters[0]
        >>> len(encounter.vehicles)
        2
    """
    if not isinstance(config, LogConfig):
        config = updated(LogConfig(), dict(config))
    config = updated(config, parameters)
    if not isinstance(path, (str, Path, Sequence)) and not hasattr(path, "to_csv"):
        raise InputError(
            f"read_log: a path, several paths or a DataFrame is needed, not {type(path).__name__}"
        )
    try:
        return _read(path, config)
    except InputError as error:
        error.add_note("In Python, --set log.NAME=VALUE is read_log(…, NAME='VALUE').")
        raise


def _read(path: "Path | str | Sequence[Path | str] | DataFrame", config: LogConfig) -> LogResult:
    """Read files, or a DataFrame as a file.

    Raises:
        InputError: as `read_log`.
    """
    if not isinstance(path, (str, Path, Sequence)):
        with scratch() as folder:
            file = folder / _DATAFRAME_FILE
            with naming_inputs({str(file): "the DataFrame"}):
                path.to_csv(file, index=False)
                return _read(file, config)
    paths = [Path(name) for name in ([path] if isinstance(path, (str, Path)) else path)]
    results = [_read_one(group, config) for group in logs_in(paths)]
    return results[0] if len(results) == 1 else _joined(results, paths[0].name)


def _read_one(paths: list[Path], config: LogConfig) -> LogResult:
    """Read one log.

    Raises:
        InputError: as `read_log`.
    """
    log = read_raw(paths, config)
    with reading(paths[0]):
        return encounters_of(log, config)


def _joined(results: Sequence[LogResult], name: str) -> LogResult:
    """Return the encounters of several logs of a folder."""
    qualities = [result.quality for result in results]
    names = ", ".join(quality.name for quality in qualities)
    notes = [f"the folder has {len(results)} logs, each with its own clock: {names}"]
    for quality in qualities:
        notes += [f"{quality.name}: {note}" for note in quality.notes]
    return LogResult(
        tuple(chain.from_iterable(result.encounters for result in results)),
        Quality(
            name=name,
            rows=sum(quality.rows for quality in qualities),
            dropped=tuple(chain.from_iterable(quality.dropped for quality in qualities)),
            vehicles=tuple(chain.from_iterable(quality.vehicles for quality in qualities)),
            encounters=tuple(chain.from_iterable(quality.encounters for quality in qualities)),
            notes=tuple(notes),
        ),
        tuple(chain.from_iterable(result.doubts for result in results)),
    )


def encounters_of(
    log: RawLog, config: LogConfig, met_ns: tuple[int, int] | None = None
) -> LogResult:
    """Cut a raw log, from files or streams, into encounters.

    Args:
        log: the observations.
        config: how to clean and cut.
        met_ns: stamps between which vehicles must meet; None: at any time. Their manoeuvres may
            end later.

    Raises:
        NoEncounterError: there is no encounter in it; the message says how near it comes to one.
        InputError: the log cannot be used.
    """
    if log.encounters:
        return LogResult(*recorded_encounters(log, config))
    log, unit_notes, unit_doubts = interpret(newest_last(log), config)
    check_doubts(log.segments[0].label, [*log.doubts, *unit_doubts], config.allow)
    log = typed(log, config)
    recorded_ns = log.vehicles[0].fix_ns[:1]
    log, clock_notes = retimed(log, config)
    signals = moved_signals(log.signals, log.vehicles[0].fix_ns[:1] - recorded_ns)
    tracks, drops = clean(log, config)
    if len({track.id for track in tracks}) < 2:
        raise NoEncounterError(explain_few_vehicles(log, [track.id for track in tracks], drops))
    tracks = tuple(sorted(tracks, key=lambda track: natural(track.id)))

    origin_ns = _first_tick_ns(tracks, config)
    pieces, vehicles = _smooth_pieces(log, tracks, origin_ns, config)
    pieces, doubts = plausible(pieces, config)
    within = _ticks_within(met_ns, origin_ns, config)
    reasons = [*drops.notes, *doubts]
    grouping = _find_encounters(log, pieces, reasons, origin_ns, config, within)
    copies = copies_in(grouping.encounters)
    pieces, trailer_notes = coupled(pieces, grouping.encounters)
    if copies or trailer_notes:
        doubts += [*trailer_notes, *map(str, copies.values())]
        reasons = [*drops.notes, *doubts]
        pieces = [piece for piece in pieces if piece.track.id not in copies]
        grouping = _find_encounters(
            log, pieces, [*drops.notes, *doubts], origin_ns, config, within
        )
    contradictions = [*doubts_of_rows(log, drops, config), *doubts_of_pieces(pieces, origin_ns)]
    check_doubts(log.segments[0].label, contradictions, config.allow)
    all_doubts = (*log.doubts, *unit_doubts, *contradictions, *copies.values())
    signals, line_notes = lines_where_vehicles_stop(signals, grouping.encounters)
    excluded = (f"left out: {counted(log.excluded)}",) if log.excluded else ()
    notes_by_vehicle = (
        *grouping.group_notes,
        *doubts,
        *map(str, contradictions),
        *_vehicle_notes(vehicles, _unusable(log, tracks, config), grouping.members, config),
        *grouping.cut_notes,
    )
    quality = Quality(
        name=log.name,
        rows=log.rows,
        dropped=drops.located(log),
        vehicles=tuple(vehicles),
        encounters=tuple(map(encounter_quality, grouping.encounters)),
        notes=(
            *unit_notes,
            *map(str, unit_doubts),
            *clock_notes,
            *_drop_notes(log, drops),
            *drops.notes,
            *log.notes,
            *excluded,
            *line_notes,
            *dict.fromkeys(notes_by_vehicle),
        ),
    )
    encounters = tuple(with_lights(encounter, signals) for encounter in grouping.encounters)
    return LogResult(encounters, quality, all_doubts)


@dataclass(frozen=True)
class _Grouping:
    """Encounters of a log, the ids of their vehicles, and notes on groups and cuts."""

    encounters: tuple[Encounter, ...]
    members: set[str]
    group_notes: list[str]
    cut_notes: list[str]


def _ticks_within(
    met_ns: tuple[int, int] | None, origin_ns: int, config: LogConfig
) -> tuple[int, int] | None:
    """Return stamps as ticks; None stays."""
    if met_ns is None:
        return None
    period_ns = round(config.period * 1e9)
    return (met_ns[0] - origin_ns) // period_ns, -(-(met_ns[1] - origin_ns) // period_ns)


def _find_encounters(
    log: RawLog,
    pieces: Sequence[Piece],
    doubts: Sequence[str],
    origin_ns: int,
    config: LogConfig,
    within: tuple[int, int] | None,
) -> _Grouping:
    """Return the encounters of smooth pieces.

    Raises:
        NoEncounterError: there is none.
    """
    groups, group_notes = find_groups(pieces, config, within)
    if not groups:
        places = [f"{log.segments[0].label}: {note}" for note in group_notes]
        if not places and doubts:
            places = [f"{log.segments[0].label}: no two vehicles meet"]
        reasons = (*(places or [explain_no_encounter(log, pieces, config)]), *doubts)
        raise NoEncounterError("; ".join(reasons))
    encounters = []
    cut_notes: list[str] = []
    width = len(str(len(groups)))
    for number, group in enumerate(groups, 1):
        name = log.name if len(groups) == 1 else f"{log.name}-{number:0{width}d}"
        encounter, notes = cut_encounter(name, group, pieces, origin_ns, config)
        encounters.append(encounter)
        cut_notes += notes
    members = chain.from_iterable(encounter.with_trailers().ids for encounter in encounters)
    return _Grouping(tuple(encounters), set(members), group_notes, cut_notes)


def _first_tick_ns(tracks: Sequence[Observations], config: LogConfig) -> int:
    """Return the stamp of the common clock's first tick."""
    period_ns = round(config.period * 1e9)
    return min(int(track.fix_ns[0]) for track in tracks) // period_ns * period_ns


def _smooth_pieces(
    log: RawLog, tracks: Sequence[Observations], origin_ns: int, config: LogConfig
) -> tuple[list[Piece], list[VehicleQuality]]:
    """Return the pieces of all vehicles, and how well each vehicle was recorded.

    Vehicles that come near no other one are not smoothed: they are in no encounter.

    Raises:
        InputError: no motion of a car fits any vehicle.
    """
    pieces: list[Piece] = []
    vehicles = []
    cut = [cut_track(track, origin_ns, config) for track in tracks]
    raw = [pieces_of(each, origin_ns, config, smooth=False) for each in cut]
    raw_pieces = list(chain.from_iterable(track_pieces for track_pieces, _ in raw))
    near = vehicles_near(raw_pieces, config)
    for each, unsmoothed in zip(cut, raw, strict=True):
        is_near = each.track.id in near
        track_pieces, quality = pieces_of(each, origin_ns, config) if is_near else unsmoothed
        pieces += track_pieces
        vehicles.append(quality)
    if not pieces and any(vehicle.lost for vehicle in vehicles):
        raise InputError(
            f"{log.segments[0].label}: speeds and positions contradict each other for all "
            "vehicles; check their units"
        )
    return pieces, vehicles


def _unusable(log: RawLog, tracks: Sequence[Observations], config: LogConfig) -> list[str]:
    """Return the vehicles with fewer than two usable positions."""
    requested = chosen_vehicles([vehicle.id for vehicle in log.vehicles], config, log.name)
    return sorted(set(requested) - {track.id for track in tracks}, key=natural)


def _drop_notes(log: RawLog, drops: Drops) -> list[str]:
    """Return a note if many rows were dropped, with the causes."""
    if sum(drops.count.values()) <= _MANY_DROPS_SHARE * log.rows:
        return []
    causes = "; ".join(map(str, drops.located(log)))
    return [f"of {log.rows} rows these were dropped or sorted: {causes}"]


def _vehicle_notes(
    vehicles: Sequence[VehicleQuality],
    unusable: Sequence[str],
    in_encounters: set[str],
    config: LogConfig,
) -> list[str]:
    """Return notes on vehicles that are in no encounter, or whose data is not used."""
    outside = [vehicle for vehicle in vehicles if vehicle.id not in in_encounters]
    if len(outside) > config.max_vehicles:
        names = ", ".join(vehicle.id for vehicle in outside)
        notes = [f"{len(outside)} of {len(vehicles)} vehicles are in no encounter: {names}"]
    else:
        notes = [
            f"vehicle {vehicle.id} is in no encounter; it was recorded for {vehicle.seconds:.1f} s"
            for vehicle in outside
        ]
    if unusable:
        notes.append(f"fewer than two usable positions: vehicle {', '.join(unusable)}")
    notes += [
        f"vehicle {vehicle.id}: {vehicle.lost:.1f} s are left out, since no motion of a car fits "
        "its positions"
        for vehicle in vehicles
        if vehicle.lost
    ]
    return notes
