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

"""Which reader reads a path."""

from collections.abc import Sequence
from pathlib import Path

from scenario_gen.errors import InputError
from scenario_gen.guard import guarded
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.files import is_bag, is_spmd, is_table, TABLES
from scenario_gen.logs.raw import LogSource, RawLog

ACCEPTS = {"bag": is_bag, "spmd": is_spmd, "table": is_table}  # asked in this order


def source(name: str) -> LogSource:
    """Return the reader of a format; its libraries are loaded only now, for each takes up to a second."""
    if name == "bag":
        from scenario_gen.logs import bag

        return bag
    if name == "spmd":
        from scenario_gen.logs import spmd

        return spmd
    from scenario_gen.logs import table

    return table


def read_raw(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read one log from files or a folder with the first source that accepts all of them."""
    with guarded(str(paths[0]), OSError):  # no permission, a name too long, a file that goes away
        files = [file for path in paths for file in present(path)]
        suited = [
            name
            for name, accepts in ACCEPTS.items()
            if name == config.format or (config.format == "auto" and all(accepts(file) for file in files))
        ]
    if suited:
        return source(suited[0]).read(files, config)
    raise InputError(
        f"{paths[0]} is none of the known logs: {', '.join(TABLES)} tables and SPMD files, "
        "rosbag2 folders, .mcap, .db3; set the parameter format if its name misleads"
    )


def present(path: Path) -> list[Path]:
    """Return the files to read of a path.

    Raises:
        InputError: there is nothing there that can be read.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if not (path.is_file() or path.is_dir()):
        raise InputError(f"{path} is neither a file nor a folder")
    if path.is_dir() and not any(path.iterdir()):
        raise InputError(f"{path} is an empty folder")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"{path} is empty (0 bytes); record or copy it again")
    return expand(path)


def expand(path: Path) -> list[Path]:
    """Return the files of a folder of tables; a file and a bag's folder stand for themselves."""
    if path.is_file() or is_bag(path):
        return [path]
    return sorted(file for file in path.iterdir() if is_table(file) and file.stat().st_size) or [path]
