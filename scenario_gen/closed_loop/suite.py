# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A suite: planners side by side in the scenarios of many bags, by kind of encounter."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import json
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from scenario_gen.bags.recordings.read import read_recording, result_in
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.files import files_of, METADATA
from scenario_gen.base.documents import read_text
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import write_text
from scenario_gen.closed_loop.coordination_space import ego_index
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.results import as_junit, drawings, Drives, JUNIT
from scenario_gen.closed_loop.trials import passed_of, Rate, read_trials
from scenario_gen.method.evaluation import footprint_distance
from scenario_gen.numerics import Floats
from scenario_gen.output.report.html import render_page
from scenario_gen.situation import EncounterKind, kind_of
from scenario_gen.types import mask

JSON, PAGE = "suite.json", "suite.html"
MAX_LIST_BYTES = 1024 * 1024
MAX_REPLAYS_COUNT = 1000
REPLAY_BYTES = 900_000  # of the motions of all replays; with many, each has fewer frames
FRAME_BYTES = 11  # of one vehicle: four 16-bit numbers in base64
MIN_FRAMES_COUNT = 12


class Category(NamedTuple):
    """The kind of an encounter, and the type of the road user that the ego meets."""

    kind: str
    road_user: str


@dataclass(frozen=True)
class Row:
    """The rates of passed scenarios of one category, one for each planner."""

    category: Category
    passed: tuple[Rate, ...]


def bags_in(sources: Sequence[Path]) -> list[Path]:
    """Return the bags of sources: bags, folders with bags below them, and lists of paths.

    A list is a text file with one path per line, relative to the folder of the list.

    Raises:
        InputError: a list cannot be read.
    """
    bags = (bag for source in sources for bag in list(_bags_of(source)) or [source])
    return list(dict.fromkeys(bags))


def _bags_of(source: Path) -> Iterator[Path]:
    if not source.exists() or (source / METADATA).exists() or files_of(source).files:
        yield source
    elif source.is_dir():
        bags = sorted(file.parent for file in source.rglob(METADATA))
        if not bags and (source / "batch.json").exists():
            remedy = f"`scenario-gen find {source} --bag BAG` writes one"
            raise InputError(f"{source} is a batch without bags; {remedy}")
        yield from bags
    else:
        name = f"{source} (must be a bag, a folder with bags, or a list of their paths)"
        paths = map(str.strip, read_text(source, MAX_LIST_BYTES, name).splitlines())
        yield from bags_in([source.parent / path for path in paths if path and path[0] != "#"])


def read_suite(bags: Sequence[Path], ego: str = "", count: int = 0) -> list[Trial]:
    """Return the scenarios of bags; with several, the names begin with the place of the bag.

    Arguments and errors are as in `read_trials`, `count` is for each bag.
    """
    return [
        replace(trial, name=_name(place, trial.name))
        for bag, place in zip(bags, _places(bags), strict=True)
        for trial in read_trials(bag, ego, count)
    ]


def _places(bags: Sequence[Path]) -> list[str]:
    """Return the place of each bag; "" for a single one."""
    root = os.path.commonpath([bag.resolve() for bag in bags])
    places = [os.path.relpath(bag.resolve(), root) for bag in bags]
    return places if len(places) > 1 else [""]


def _name(place: str, name: str) -> str:
    return f"{place} {name.lstrip('/')}" if place else name


def write_selection(folder: Path, bags: Sequence[Path], names: Collection[str]) -> None:
    """Write the scenarios whose trials have some names to a bag, with recordings and roads.

    Of several requests in one namespace only the last one is searched, as in `load`.

    Raises:
        InputError: a road or a fit is unknown, or a bag cannot be read or written.
    """
    results = {}
    for number, (bag, place) in enumerate(zip(bags, _places(bags), strict=True)):
        recording = read_recording(bag)
        for namespace in recording.results:
            result = result_in(recording, namespace)
            chosen = tuple(
                scenario
                for scenario in result
                if _name(place, f"{namespace} {scenario.index}".strip()) in names
            )
            if chosen:
                generated = replace(result.generated, scenarios=chosen)
                prefix = f"/bag_{number}" if place else ""
                results[prefix + namespace] = result.with_scenarios(generated)
    write_recording(folder, results)


def category_of(trial: Trial) -> Category:
    """Return the category of a scenario by the vehicle that comes nearest to the ego in it."""
    scenario = trial.scenario
    ego = ego_index(scenario, trial.ego)
    present = mask(scenario.present, len(scenario.time))
    nearest, least = ego, np.inf
    for other in range(len(scenario.vehicles)):
        both = present[ego] & present[other]
        gap = footprint_distance(scenario, ego, other)[both].min(initial=np.inf)
        if other != ego and gap < least:
            nearest, least = other, gap
    if nearest == ego:
        return Category(EncounterKind.OTHER.value, "nobody")
    return Category(kind_of(scenario, ego, nearest).value, scenario.vehicles[nearest].type)


def population_weights(trials: Sequence[Trial]) -> Floats:
    """Return the weights (S,) of scenarios that represent the traffic of their encounters.

    All encounters weigh the same. The outcomes of a decision share the weight of their encounter
    by probability, and scenarios that share an outcome by their importance weights.
    """
    facts = [trial.scenario.facts for trial in trials]
    table = pd.DataFrame(
        {
            "encounter": [trial.encounter for trial in trials],
            "decision": [each.decision for each in facts],
            "probability": [each.decision.probability if each.decision else 1.0 for each in facts],
            "weight": [each.weight or 1.0 for each in facts],
        }
    )
    groups = table.groupby(["encounter", "decision"], sort=False, dropna=False)
    weights = table.weight * table.probability / groups.weight.transform("sum")
    return np.asarray(weights / weights.mean())


@dataclass(frozen=True, eq=False)
class Suite:
    """The results of planners in the same S scenarios.

    Attributes:
        drives: the results of each planner.
        bags: the bags of the scenarios.
    """

    drives: Sequence[Drives]
    bags: Sequence[Path]

    @cached_property
    def scenarios(self) -> pd.DataFrame:
        """The scenarios, a row each: name, kind of encounter, type of road user, and weight."""
        trials = self.drives[0].trials
        table = pd.DataFrame(map(category_of, trials), columns=Category._fields)
        table.insert(0, "name", [trial.name for trial in trials])
        return table.assign(weight=population_weights(trials))

    @property
    def is_single(self) -> bool:
        """Whether it has one bag and one planner, and needs no table."""
        return len(self.bags) == len(self.drives) == 1

    @property
    def planners(self) -> list[str]:
        """Names of the planners: their classes, if these differ."""
        names = [drives.planner for drives in self.drives]
        short = [name.rpartition(":")[2] for name in names]
        return short if len(set(short)) == len(names) else names

    @property
    def broken(self) -> list[str]:
        """Sentences on the thresholds that are not met."""
        if len(self.drives) == 1:
            return list(self.drives[0].broken)
        named = zip(self.planners, self.drives, strict=True)
        return [f"{name}: {', '.join(each.broken)}" for name, each in named if each.broken]

    def notes(self) -> list[str]:
        """Return sentences that qualify the figures; those for one planner begin with its name."""
        sentences = [drives.notes() for drives in self.drives]
        common = [text for text in sentences[0] if all(text in each for each in sentences)]
        return common + [
            f"{name}: {text}"
            for name, each in zip(self.planners, sentences, strict=True)
            for text in each
            if text not in common
        ]

    def table(self) -> list[Row]:
        """Return the shares of passed scenarios of all, then of each category, worst first."""
        groups = self.scenarios.groupby([*Category._fields], sort=False).indices
        rows = [self._row(Category(*name), members) for name, members in groups.items()]
        rows.sort(key=lambda row: min(rate.share.value for rate in row.passed))
        return [self._row(Category("all", ""), self.scenarios.index), *rows]

    def _row(self, category: Category, members: Iterable[int]) -> Row:
        weights = self.scenarios.weight.to_numpy()[members]
        passed = (
            passed_of([drives.outcomes[k] for k in members], weights) for drives in self.drives
        )
        return Row(category, tuple(passed))

    def document(self) -> dict[str, Any]:
        """Return the table and the scenarios as JSON's types."""
        return {
            "planners": [drives.planner for drives in self.drives],
            **self.drives[0].config.facts(),
            "bags": [str(bag) for bag in self.bags],
            "table": [
                {**row.category._asdict(), "passed": [rate.document() for rate in row.passed]}
                for row in self.table()
            ],
            "notes": self.notes(),
            "thresholds_not_met": self.broken,
            "scenarios": self.scenarios.round(6).to_dict("records"),
        }

    def write(self, folder: Path) -> None:
        """Write the results of all planners, and the table and its page, to an existing folder.

        Raises:
            OSError: the disk is full, or the folder is not writable.
        """
        if len(self.drives) == 1:
            self.drives[0].write(folder)
        else:
            for number, drives in enumerate(self.drives, start=1):
                write_text(folder / f"drives-{number}.json", drives.json())
            write_text(folder / JUNIT, as_junit(*self.drives))
        if not self.is_single:
            text = json.dumps(self.document(), indent=1, ensure_ascii=False, allow_nan=False)
            write_text(folder / JSON, text + "\n")
            write_text(folder / PAGE, self.page())

    def page(self) -> str:
        """Return the page: the table, and all scenarios with the planners side by side."""
        trials, planners = self.drives[0].trials, range(len(self.drives))
        cells = sorted(
            (drives.outcomes[k].verdict.severity, k, number)
            for number, drives in enumerate(self.drives)
            for k in range(len(trials))
        )
        rank = np.empty((len(trials), len(planners)), dtype=np.int64)
        for place, (_, k, number) in enumerate(cells):
            rank[k, number] = place
        order = np.argsort(-rank.max(axis=1)).tolist()
        shown = order[: max(1, MAX_REPLAYS_COUNT // len(planners))]
        driven = [(number, k) for k in shown for number in planners]
        outcomes = [self.drives[number].outcomes[k] for number, k in driven]
        of_drives = [trials[k] for _, k in driven]
        vehicles = sum(len(trial.scenario.vehicles) for trial in of_drives)
        frames = max(REPLAY_BYTES // (FRAME_BYTES * vehicles), MIN_FRAMES_COUNT)
        data = drawings(outcomes, of_drives, range(len(driven)), frames)
        for drawing, (number, _) in zip(data["drives"], driven, strict=True):
            drawing["sentence"] = f"{self.planners[number]}: {drawing['sentence']}"
        return render_page(
            "suite.html.j2",
            ("scene.js", "drives.js", "tables.js"),
            data,
            suite=self,
            rank=rank.tolist(),
            worst=rank.argmax(axis=1).tolist(),
            order=order,
            shown=len(shown),
        )
