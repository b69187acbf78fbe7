# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a user of the core alone does; run as a script, it says in JSON what it got: `core_use.py LOG.csv`."""

import json
import sys

from scenario_gen import evaluate, generate, MissingExtraError, read_log, segment

(encounter,) = read_log(sys.argv[1]).encounters
made = generate(encounter, "t_intersection", count=4, seed=7)
refusals = []
for use in ("scenario_gen.bags.recordings", "scenario_gen.output.report"):
    try:
        __import__(use)
    except MissingExtraError as error:
        refusals.append(str(error))
answer = {
    "changepoints": segment(encounter, seed=7).changepoints.tolist(),
    "scenarios": len(made.generated.scenarios),
    "same": evaluate(made).to_json() == made.evaluation.to_json(),
    "refusals": refusals,
    "loaded": sorted(
        {name.partition(".")[0] for name, module in sys.modules.items() if module is not None}
    ),
}
json.dump(answer, sys.stdout)
