# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of mining, and where a corpus keeps what."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import INTERACTS_M, LogConfig


@dataclass(frozen=True)
class CorpusConfig(Parameters):
    """How an archive is mined, and how the work is spread."""

    range_size: int = parameter(
        512,
        "bytes of text that one task parses, several seconds' work",
        unit="MiB",
        low=1,
        high=4096,
    )
    task_rows: int = parameter(
        10_000_000,
        "rows whose hours one task searches, so that none is shorter than its start",
        low=1000,
    )
    task_encounters: int = parameter(100, "encounters that one task cleans", low=1, high=100_000)
    memory: int = parameter(
        400,
        "memory that the database of one task takes before it spills to disk",
        unit="MiB",
        low=100,
    )
    slack: float = parameter(
        10.0,
        "metres beyond the proximity within which a coarse position still makes a candidate",
        unit="m",
        low=0.0,
        high=100.0,
    )
    interaction: float = parameter(
        INTERACTS_M,
        "space-time gap below which two vehicles have to do with each other: a second counts 2 m",
        unit="m",
        low=0.1,
        high=200.0,
    )
    log: LogConfig = LogConfig()
