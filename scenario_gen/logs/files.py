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

"""What a file or folder looks like, told without loading the libraries that read it."""

from pathlib import Path

from scenario_gen.storage.files import files_of

TABLES = (".csv", ".tsv", ".txt", ".parquet", ".pq")
# Of a basic safety message in the files of the Safety Pilot Model Deployment.
COLUMNS = (
    "RxDevice",
    "FileId",
    "TxDevice",
    "Gentime",
    "TxRandom",
    "MsgCount",
    "DSecond",
    "Latitude",
    "Longitude",
    "Elevation",
    "Speed",
    "Heading",
    "Ax",
    "Ay",
    "Az",
    "Yawrate",
    "PathCount",
    "RadiusOfCurve",
    "Confidence",
)


def is_bag(path: Path) -> bool:
    """Return whether it is a bag's folder or a bare .mcap or .db3 file."""
    return bool(files_of(path).files)


def is_spmd(path: Path) -> bool:
    """Return whether the first line has 19 fields and all of them are numbers."""
    if path.suffix.lower() not in (".csv", ".txt"):
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        fields = file.readline().split(",")
    return len(fields) == len(COLUMNS) and all(is_number(field) for field in fields)


def is_number(field: str) -> bool:
    """Return whether a field is empty or a number, as every field of a basic safety message is."""
    try:
        float(field.strip() or "nan")
    except ValueError:
        return False
    return True


def is_table(path: Path) -> bool:
    """Return whether the name says table; a headerless one is asked for as SPMD first."""
    return path.suffix.lower() in TABLES
