# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner among the scenarios of one template, as a function of the sampler's numbers; each drive is written to a journal."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any, TextIO

from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.folders import write_text
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.search.estimate import Response
from scenario_gen.closed_loop.search.nearness import time_apart
from scenario_gen.closed_loop.search.objective import Objective
from scenario_gen.closed_loop.trials import RunTrials
from scenario_gen.method.sampling import NaturalScenarios
from scenario_gen.numerics import Floats
from scenario_gen.types import mask, Road, Scenario


@dataclass(frozen=True, eq=False)
class Journal:
    """The drives of a search in a file, one line each, written as they end; a search that goes on reads them again.

    Attributes:
        known: responses of the drives that the file had.
        file: where further ones go.
    """

    known: list[Response]
    file: TextIO

    def add(self, response: Response) -> None:
        """Write one drive."""
        self.file.write(json.dumps([response.margin, response.parts, response.kind], ensure_ascii=False) + "\n")
        self.file.flush()


@contextmanager
def open_journal(path: Path, identity: Mapping[str, Any]) -> Iterator[Journal]:
    """Yield the journal at a path, made if it is not there; `identity` says what the drives hang on.

    Raises:
        InputError: the file is of another search, is no journal, or cannot be written.
    """
    head = json.dumps(identity, sort_keys=True, ensure_ascii=False)
    try:
        lines = path.read_text().splitlines(keepends=True) if path.exists() else []
        whole = [line for line in lines if line.endswith("\n")]  # the last one may have been cut off
        if whole:
            before, now = json.loads(whole[0]), json.loads(head)
            differ = [name for name in now if not isinstance(before, dict) or before.get(name) != now[name]]
            if differ:
                raise InputError(
                    f"{path} has the drives of another search ({', '.join(differ)} differ); move it away, or give another --out"
                )
        known = [Response(float(margin), tuple(parts), kind) for margin, parts, kind in map(json.loads, whole[1:])]
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path} is no journal of a search ({error}); move it away, or give another --out") from error
    except OSError as error:
        raise of_system(error, path, "; give another --out") from error
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if len(whole) != len(lines) or not whole:
            write_text(path, "".join(whole) or head + "\n")
        file = path.open("a")
    except OSError as error:
        raise of_system(error, path, "; give another --out") from error
    with file:
        yield Journal(known, file)


@dataclass(eq=False)
class DrivenScenarios:
    """The problem of a search: candidates are scenarios, and a planner drives in the place of one of their vehicles.

    Attributes:
        natural: makes scenarios of numbers.
        ego: id of the vehicle in whose place the planner drives.
        road: of the scenarios.
        objective: what counts as a failure.
        run: drives trials.
        journal: of the drives.
        progress: called with the number of drives.
    """

    natural: NaturalScenarios
    ego: str
    road: Road
    objective: Objective
    run: RunTrials
    journal: Journal
    progress: Callable[[int], None] = lambda _: None
    driven: int = 0

    @property
    def size(self) -> int:
        """Standard normal numbers of a scenario."""
        return self.natural.size

    def candidates(self, z: Floats) -> list[Scenario | None]:
        """Return the certified scenarios of numbers (S, size)."""
        return self.natural.scenarios(z)

    def features(self, candidate: Scenario) -> tuple[float, ...]:
        """Return how far in time [s] the witness is from a collision with each of the others, and its first speed [m/s]."""
        ids = [vehicle.id for vehicle in candidate.vehicles]
        ego = ids.index(self.ego)
        here = mask(candidate.present, len(candidate.time))
        apart = (time_apart(candidate, here, ego, k) for k in range(len(ids)) if k != ego)
        return (*apart, float(candidate.speed[ego, int(candidate.present[ego, 0])]))

    def drive(self, candidates: Sequence[Scenario]) -> list[Response]:
        """Drive in each, unless the journal knows how that ended."""
        first = self.driven
        known = self.journal.known[first : first + len(candidates)]
        results = list(known)
        trials = [self.trial(first + k, one) for k, one in enumerate(candidates)][len(known) :]
        for outcome in self.run(trials):
            results.append(self.objective.response(outcome))
            self.journal.add(results[-1])
            self.progress(first + len(results))
        self.driven = first + len(candidates)
        return results

    def trial(self, number: int, scenario: Scenario) -> Trial:
        """Return the trial of a drive, counted from 0; its name counts from 1."""
        return Trial(str(number + 1), scenario, self.ego, self.road)
