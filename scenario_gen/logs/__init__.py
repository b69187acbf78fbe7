# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Raw files and bags -> encounters (paper II-A)."""

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import Quality
from scenario_gen.logs.read import encounters_of, LogResult, read_log
from scenario_gen.logs.streams import Sample, Streams

__all__ = ["LogConfig", "LogResult", "Quality", "Sample", "Streams", "encounters_of", "read_log"]
