"""Which reader reads a path."""

from collections.abc import Sequence
from pathlib import Path

from scenario_gen.errors import InputError
from scenario_gen.logs.bag import BagSource, bag_files
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import LogSource, RawLog
from scenario_gen.logs.spmd import SpmdSource
from scenario_gen.logs.table import TableSource

SOURCES: dict[str, LogSource] = {"bag": BagSource(), "spmd": SpmdSource(), "table": TableSource()}


def read_raw(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read one log from files or a folder with the first source that accepts all of them."""
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist")
        if path.is_dir() and not any(path.iterdir()):
            raise InputError(f"{path} is an empty folder")
        if path.is_file() and path.stat().st_size == 0:
            raise InputError(f"{path} is empty (0 bytes); record or copy it again")
    files = [file for path in paths for file in expand(path)]
    for name, source in SOURCES.items():
        if name == config.format or (config.format == "auto" and all(source.accepts(file) for file in files)):
            return source.read(files, config)
    raise InputError(
        f"{paths[0]} is none of the known logs: {', '.join(TableSource.extensions)} tables and SPMD files, "
        "rosbag2 folders, .mcap, .db3; set the parameter format if its name misleads"
    )


def expand(path: Path) -> list[Path]:
    """Return the files of a folder of tables; a file and a bag's folder stand for themselves."""
    if path.is_file() or bag_files(path):
        return [path]
    tables = sorted(file for file in path.iterdir() if file.suffix.lower() in TableSource.extensions and file.stat().st_size)
    return tables or [path]
