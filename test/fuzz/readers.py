# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which modules take files or messages of others apart, found by walking the sources; and which target is for which."""

from pathlib import Path
import re

PACKAGES = [Path(__file__).resolve().parents[2] / name for name in ("scenario_gen", "msg_conventions")]
PARSING = re.compile(
    r"(?<!def )\b(read_(text|bytes|csv|parquet|schema|table|yaml|json|xml)|parse_(yaml|json)|ParquetFile|loads|fromstring"
    r"|iterparse|connect|deserialize_cdr|ZstdDecompressor|Reader)\("
)
OF_TARGETS = {
    "table": ("logs/tables.py", "logs/read.py"),
    "parquet": ("logs/parquet.py",),
    "argoverse2": ("logs/adapters/tracks.py",),
    "commonroad_log": ("logs/adapters/commonroad.py",),
    "nocturne": ("logs/adapters/nocturne.py",),
    "osi": ("logs/adapters/osi.py",),
    "mcap_log": ("bags/vehicles.py", "bags/storage/bag.py"),
    "sqlite_log": ("bags/storage/others.py",),
    "mcap_reader": ("bags/storage/mcap.py",),
    "metadata": ("bags/storage/files.py", "base/documents.py"),
    "reindex": ("bags/storage/reindex.py", "bags/storage/metadata.py"),
    "import_openscenario": ("output/exchange/importing.py", "output/exchange/xml.py"),
    "map": ("roads/nav2.py",),
    "vector_map_osm": ("roads/vector/read.py", "roads/vector/lanelet2.py", "base/markup.py"),
    "vector_map_xodr": ("roads/vector/opendrive.py",),
    "vector_map_xml": ("roads/vector/commonroad.py",),
    "parameters": ("base/parameters.py",),
    "library": ("method/segmentation/library.py",),
    "evaluation_json": ("method/evaluation/comparison.py", "types/evaluation.py"),
    "drives_json": ("closed_loop/comparison.py",),
    "batch": ("corpus/find.py",),
    "corpus": ("corpus/encounters.py",),
    "archive": ("corpus/messages.py",),
    "message_changepoints": ("changepoints.py",),
    "message_diagnostics": ("diagnostics.py", "scenario_info.py"),
    "message_scenarios": ("trajectory.py", "cdr.py"),
    "message_odometry": ("ego.py", "odometry.py"),
    "message_frames": ("frames.py",),
    "message_lanes": ("lanes.py",),
    "message_route": ("paths.py",),
    "message_footprint": ("pictures.py",),
    "message_map": ("roads.py",),
    "message_fix": ("streams.py",),
    "message_fit": ("fits.py",),
}
OWN = {  # modules that parse, but no file that a user is given by others, and why that is so
    "cli/bags.py": "figures that it has just computed",
    "cli/generation.py": "the first bytes of a picture that it is about to replace",
    "output/exchange/osi.py": "a map, which the reader of maps has read",
    "output/exchange/export.py": "copies a map, which the reader of maps has read",
    "cli/launching.py": "parameter files, through `documents`",
    "corpus/batch.py": "its own notes in its own folder, through `documents`",
    "corpus/mine.py": "its own intermediate tables, which are written whole or not at all",
    "corpus/tasks.py": "its own note in its own folder, through `documents`",
    "corpus/meetings.py": "its own intermediate tables, likewise",
    "base/folders/replace.py": "what is none is no marker: test/base/folders",
    "base/folders/scratch.py": "the lock of a command, which this project writes: test/base/folders",
    "output/results.py": "its own notes in its own folder",
    "corpus/grouping.py": "tables of meetings that the run before it has just written",
    "numerics/kernel_cache.py": "source files of the package, to see which have kernels",
    "output/report/html.py": "assets of the package",
    "closed_loop/search/problem.py": "its own journal; what is none is refused: test/closed_loop/search",
    "bags/storage/definitions.py": "definitions of messages that ROS 2 has installed",
}


def parsing_modules() -> set[str]:
    """Return the modules outside of the nodes that call what parses, by their paths in their packages."""
    files = [(path, package) for package in PACKAGES for path in package.rglob("*.py") if package / "ros" not in path.parents]
    return {str(path.relative_to(package)) for path, package in files if PARSING.search(path.read_text(encoding="utf-8"))}
