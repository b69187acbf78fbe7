"""Raw files and bags -> encounters (paper II-A)."""

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import Quality
from scenario_gen.logs.read import LogResult, read_log

__all__ = ["LogConfig", "LogResult", "Quality", "read_log"]
