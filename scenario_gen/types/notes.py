# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Notes: what a stage reports to the user, as a kind with values.

This file has the wording of all notes.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum, unique


@unique
class NoteKind(Enum):
    """What a note reports. The value is its sentence, a format string over the note's values."""

    TEXT = "{text}"  # from a recording of another version, or from a plugin

    # Roads and maps.
    MIRRORED = "recording mirrored: road {road} has {side}-hand traffic"
    NO_RING = "no recorded vehicle drives around a ring; radius set to {radius:.0f} m"
    COORDINATES = "{format}: coordinates unchanged, in metres"
    GEOREFERENCE_IGNORED = "geoReference {reference} found but not applied"
    OFFSET_IGNORED = "offset x {x:g}, y {y:g} found but not applied"
    LOCAL_TAGS = "Lanelet2: coordinates from the tags local_x and local_y, in metres"
    PROJECTED = (
        "Lanelet2: latitude and longitude converted to metres east and north of "
        "{latitude:.7f}, {longitude:.7f} (azimuthal equidistant, WGS84)"
    )
    FAULTY = "{count} faulty {elements} left out ({names}), first: {reason}"
    OTHER_LANES = "{count} lanes are closed to cars: {users}"
    UNUSED_LANES = "{count} lanes left out: no supported road user may use them"
    UNREAD_SIGNS = "{count} signs left out: not stop, give way, priority or speed limit"
    MAP_OBSTACLES = (
        "{count} static obstacles of the map: where they are on lanes, vehicles drive around them"
    )
    TRAFFIC_RULES = "traffic rules: {rules}"
    LIGHTS_OFF = "traffic lights have no state: the signs apply"
    MAP_PART = "part {part} of the map"
    MAP_AROUND = "{distance:g} m around {part}"
    BEST_PLACE = "best place for the recording: {place}: {part} (cost {cost:.1f} m²)"

    # Fitting.
    DRIVEN_ON = (
        "vehicle {vehicle} drives on for {time:.1f} s after its record, which ends in another "
        "vehicle's way"
    )
    AT_HOME = "placed on road {road} in the recording's own frame"
    AS_ONE_PIECE = (
        "placed on road {road} as one piece: rotated by {degrees:.0f}°, scale {scale:g}, "
        "centre at x {x:.1f}, y {y:.1f}"
    )
    ON_LANES = "vehicle {vehicle} drives on lanes {lanes}"
    SCALED = "scaled by {scale:.3g} to fit the lanes"
    STATE_GIVEN = "vehicle {vehicle}: {states} as given, {method}"
    ANCHOR_MOVED = "vehicle {vehicle}: {anchor} moved by {distance:.2f} m to where it has room"
    SEPARATED = (
        "vehicle {vehicle} came within {gap:.2f} m of another: path shifted by {sideways:.2f} m "
        "to the {side} and {along:.2f} m {direction}"
    )
    SMOOTHED = "vehicle {vehicle}: record smoothed by up to {distance:.2f} m into a drivable path"

    # Sampling.
    SHORTENED = "shortened to fit the road: {parts} ({reason})"
    AUTO_ROAD = "road auto: {road}, the first built-in road on which the encounter is unchanged"
    OUTCOMES = "outcomes of the decision: {mix}"
    OUTCOMES_MISSING = "outcomes that are not possible, probability {probability}: {reasons}"
    OUTCOME_REFUSED = "{decision} is not possible on this road: {reason}"
    NOTHING_DECIDED = "decisions: only the recorded outcome: {reason}"
    NOT_DRIVABLE = "{reasons}"
    SLOWED = (
        "slowed by up to {percent:.0f} % before bends, most for vehicle {vehicle} at {time:.1f} s "
        "(+{delay:.1f} s overall)"
    )
    STRETCHED = (
        "clock stretched by {percent:.1f} % so that every vehicle meets its limits "
        "and changepoints"
    )
    CHANGEPOINTS_SHIFTED = "vehicle {vehicle} passes changepoints up to {distance:.2f} m off"
    JERKY = "vehicle {vehicle} needs a jerk of {jerk:.1f} m/s³ (smooth: {smooth:.1f} m/s³)"
    NARROW = (
        "vehicle {vehicle} has less lateral variation on {percent:.0f} % of its route, "
        "where the road is narrow"
    )
    REACTION_LOST = "reaction lost on this road: {message}"
    NO_SHARED_AREA = "vehicles share no area: every valid scenario counts as usual"
    UNUSUAL = (
        "the recording is unusual among recorded encounters (rarity 1): "
        "scenarios up to {rarity:.2f} are kept"
    )
    FEW_VALID = "few candidates were valid; smaller standard deviations did not help"
    LESS_VARIATION = (
        "few candidates were valid: standard deviations multiplied by {lateral:g} across the "
        "route, {longitudinal:g} along it, {time:g} in time"
    )
    LESS_VARIATION_EACH = (
        "few candidates were valid: standard deviations multiplied by {lateral:g} across the "
        "route, {longitudinal:g} along it, {time:g} in time, {vehicle:g} of each vehicle's clock"
    )
    TARGET_REACHED = (
        "target {target}: {share:.3g} % [{low:.3g}, {high:.3g}] of natural candidates are valid "
        "and in the range; {sampling}"
    )
    TARGET_MISSED = "target {target}: {found} found in {drawn} candidates; reachable: {reachable}"
    CANCELLED = "cancelled"
    FILTERED = "filtered by {condition!r}: {kept} of {total} scenarios"
    EGO_TESTS = (
        "for testing ego {ego}: {kept} of {requested} scenarios found in which it has to react"
        "{reason}{advice}"
    )
    SEARCHED = "failures of {planner}, found by a search: not a random sample of natural scenarios"

    # Evaluation.
    RESAMPLED = "longer than max_steps and max_entries allow: feature matrices have {steps} steps"
    EMPTY = "this row has no scenarios"
    PAIRS_LEFT_OUT = "E leaves out {count} pair(s) of vehicles not present together for {time:g} s"
    SUBSET_MEASURED = (
        "measured on {measured:,} of {total:,} scenarios, in {runs} evenly spaced runs"
    )
    FEW_SCENARIOS = "few scenarios: all figures come from {measured} scenarios, not {enough}"
    ONE_VEHICLE = "one vehicle is left: no pair to measure"
    E_UNDEFINED = "E for {quantity} is undefined: the recording's matrices are constant"
    CONFLICTS_VANISHED = "{vanished:.3g} of {total:.0f} recorded conflict(s) vanish on average"
    BAG_MEASURED = "all scenarios in the bag are shown and measured, valid or not"
    NOT_MEASURED = "not measured: {reason}"
    NOT_CHECKED = "not checked in {count} scenarios: {check}"
    UNACCOUNTED = "{count} of {total} scenarios are unaccounted for: {reason}"


@dataclass(frozen=True, eq=False)
class Note:
    """Something that a stage reports to the user. Program logic reads the kind, never the text.

    Attributes:
        kind: what is reported.
        values: the numbers and names in its sentence.
        recorded: its sentence in a recording; "" if the note does not come from a recording.
    """

    kind: NoteKind
    values: Mapping[str, object] = field(default_factory=dict)
    recorded: str = ""

    @classmethod
    def of(cls, kind: NoteKind, **values: object) -> "Note":
        """Return the note of a kind with these values."""
        return cls(kind, values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Note) and (self.kind, str(self)) == (other.kind, str(other))

    def __hash__(self) -> int:
        return hash((self.kind, str(self)))

    def __str__(self) -> str:
        return self.recorded or self.kind.value.format_map(self.values)


def note_kinds(notes: Iterable[Note]) -> str:
    """Return the kinds of notes, to be recorded beside their texts."""
    return ";".join(note.kind.name.lower() for note in notes)


def recorded_notes(texts: Iterable[str], kinds: str) -> tuple[Note, ...]:
    """Return notes from a recording: their texts, and what `note_kinds` wrote beside them.

    A text without a known kind is of kind TEXT.
    """
    known = NoteKind.__members__
    texts = tuple(texts)
    names = kinds.upper().split(";")
    names += ["TEXT"] * (len(texts) - len(names))
    return tuple(
        Note(known.get(name, NoteKind.TEXT), recorded=text)
        for name, text in zip(names, texts, strict=False)
    )
