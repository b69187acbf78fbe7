# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Raw files and bags -> encounters (paper II-A)."""

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.files import read_raw
from scenario_gen.logs.formats import is_log, LOG_FORMATS, LogFormat
from scenario_gen.logs.gap import GAP_RATE_MPS, INTERACTS_M, space_time_gap
from scenario_gen.logs.geodesy import (
    azimuthal,
    latitude_longitude,
    local_frame,
    metres_per_degree,
    middle_of,
    parse_origin,
    reprojected,
    utm,
)
from scenario_gen.logs.groups import OUT_OF_RANGE_S, shortest, ticks, windows
from scenario_gen.logs.growing import Growth, Meeting
from scenario_gen.logs.no_encounter import NoEncounterError
from scenario_gen.logs.raw import Fix, Observations, RawLog, Rows, Segment, UnknownFormatError
from scenario_gen.logs.read import encounters_of, LogResult, read_log
from scenario_gen.logs.recognise import is_bag, is_spmd, is_table
from scenario_gen.logs.streams import Streams
from scenario_gen.logs.synthetic import bundled, CASES

__all__ = [
    "CASES",
    "GAP_RATE_MPS",
    "INTERACTS_M",
    "LOG_FORMATS",
    "OUT_OF_RANGE_S",
    "Fix",
    "Growth",
    "LogConfig",
    "LogFormat",
    "LogResult",
    "Meeting",
    "NoEncounterError",
    "Observations",
    "RawLog",
    "Rows",
    "Segment",
    "Streams",
    "UnknownFormatError",
    "azimuthal",
    "bundled",
    "encounters_of",
    "is_bag",
    "is_log",
    "is_spmd",
    "is_table",
    "latitude_longitude",
    "local_frame",
    "metres_per_degree",
    "middle_of",
    "parse_origin",
    "read_log",
    "read_raw",
    "reprojected",
    "shortest",
    "space_time_gap",
    "ticks",
    "utm",
    "windows",
]  # fmt: skip
