# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of mining."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import INTERACTS_M, LogConfig


@dataclass(frozen=True)
class CorpusConfig(Parameters):
    """Parameters of mining an archive and of distributing the work."""

    range_size: int = parameter(
        512,
        "text that one task parses (several seconds of work)",
        unit="MiB",
        low=1,
        high=4096,
    )
    task_encounters: int = parameter(100, "encounters that one task cleans", low=1, high=100_000)
    memory: int = parameter(
        400,
        "memory of one task's database; beyond it, the database spills to disk",
        unit="MiB",
        low=100,
    )
    slack: float = parameter(
        10.0,
        "margin beyond the proximity within which coarse positions make a candidate",
        unit="m",
        low=0.0,
        high=100.0,
    )
    interaction: float = parameter(
        INTERACTS_M,
        "space-time gap below which two vehicles interact; one second counts as 2 m",
        unit="m",
        low=0.1,
        high=200.0,
    )
    log: LogConfig = LogConfig()
