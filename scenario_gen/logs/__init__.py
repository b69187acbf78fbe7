"""Raw files and bags -> encounters (paper II-A)."""

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import Quality
from scenario_gen.logs.read import LogResult, encounters_of, read_log
from scenario_gen.logs.streams import Sample, Streams

__all__ = ["LogConfig", "LogResult", "Quality", "Sample", "Streams", "encounters_of", "read_log"]
