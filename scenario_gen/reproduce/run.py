# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From logs to the page of the paper's figures."""

from collections.abc import Callable, Sequence
from pathlib import Path

from scenario_gen.errors import RefusedError
from scenario_gen.folders import replaced_folder
from scenario_gen.logs import read_log
from scenario_gen.parameters import flatten
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.reproduce.chain import ROADS
from scenario_gen.reproduce.claims import claims_of
from scenario_gen.reproduce.measure import run_case
from scenario_gen.reproduce.page import PAGE, refusals, REPRODUCED, write_page
from scenario_gen.results import provenance_of

VERDICTS = {True: ", as claimed", False: ", not as claimed", None: ""}


def reproduce(
    logs: Sequence[Sequence[Path]], out: Path, *, count: int, seed: int, say: Callable[[str], None] = lambda line: None
) -> None:
    """Draw the paper's figures 2 to 5 for every encounter of `logs`, with what we measure for them, to one page and JSON.

    Args:
        logs: groups of files, each read as one log.
        out: folder of the page.
        count: scenarios per encounter and arm (the paper: 50).
        seed: same seed, same bytes.
        say: is told, line by line, what each encounter came to.

    Raises:
        InputError: a log cannot be read, or `out` holds something else.
        RefusedError: not one encounter could be placed on a road of the paper; the page is written all the same.
    """
    config = PipelineConfig()
    files = [path for group in logs for path in group]
    with replaced_folder(out, REPRODUCED, files) as partial:
        found = [read_log(list(group), config.log) for group in logs]
        cases = [run_case(encounter, count=count, seed=seed) for one in found for encounter in one.encounters]
        facts = provenance_of(files, seed, count, ROADS, config)
        own = {name: value for name, value in facts.items() if name not in flatten(config)}  # the paper's parameters are fixed
        write_page(partial, cases, quality=[line for one in found for line in one.quality.lines()], provenance=own)
    for case in cases:
        say(f"{case.encounter.name} on {case.road.name if case.road else 'no road'}")
        for line in refusals(case):
            say(f"  {line}")
        for claim in claims_of(case):
            say(f"  figure {claim.number}{VERDICTS[claim.holds]}: {claim.measured}")
    say(f"page: {out / PAGE}")
    if not any(case.arms for case in cases):
        raise RefusedError("no encounter could be placed on a road of the paper; the page says why")
