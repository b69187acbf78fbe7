# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a type checker sees of the library in a user's script; `make test` runs mypy on it, nothing runs it."""

from typing import assert_type

from scenario_gen import (
    build_road,
    Encounter,
    evaluate,
    evaluate_scenarios,
    Evaluation,
    generate,
    GenerationResult,
    Limits,
    LogResult,
    PipelineConfig,
    read_log,
    Road,
    segment,
    Segmentation,
)

found = read_log("my_log.csv")
assert_type(found, LogResult)
encounter = found.encounters[0]
assert_type(encounter, Encounter)
assert_type(segment(encounter), Segmentation)
road = build_road("t_intersection", encounter)
assert_type(road, Road)
made = generate(encounter, road, PipelineConfig(limits=Limits()), count=5)
assert_type(made, GenerationResult)
assert_type(evaluate(made), Evaluation)
assert_type(evaluate_scenarios(encounter, made.generated), Evaluation)
assert_type(evaluate_scenarios(encounter, {"mine": made.generated.scenarios}), Evaluation)
