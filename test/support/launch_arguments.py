# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arguments of the launch files: `python test/support/launch_arguments.py`, from test/, writes the table of them anew."""

from dataclasses import Field
import json
from typing import Any

from scenario_gen.base.parameters import flatten, parameter
from scenario_gen.ros.common.ros_parameters import config_of
from scenario_gen.ros.common.start import node_class
from scenario_gen.ros.launch_arguments import TABLE
from scenario_gen.ros.node_names import GENERATORS, SUITE

OF_ALL_NODES = {
    "use_sim_time": parameter(False, "the nodes follow /clock"),
    "autostart": parameter(True, "the nodes configure and activate themselves"),
}


def _row(entry: "Field[Any]", nodes: list[str]) -> dict[str, object]:
    row = {key: value for key, value in entry.metadata.items() if value not in ("", None, ())}
    row.pop("fixed", None)
    return {"default": entry.default, **row, "nodes": nodes}


def table_text() -> str:
    """Return the table as JSON, a line for each argument."""
    suite = dict.fromkeys((*GENERATORS, *SUITE))  # the meanings of the generators
    files = {"suite.launch.py": suite, "drive.launch.py": ("traffic",)}
    parts = []
    for file, nodes in files.items():
        rows: dict[str, dict[str, object]] = {}
        for node in nodes:
            for name, (entry, _) in flatten(config_of(node_class(node))).items():
                row = rows.setdefault(name, _row(entry, []))
                row["nodes"].append(node)
        if file == "suite.launch.py":
            rows |= {name: _row(entry, []) for name, entry in OF_ALL_NODES.items()}
        lines = (
            f"{json.dumps(name)}: {json.dumps(row, ensure_ascii=False)}"
            for name, row in rows.items()
        )
        parts.append(json.dumps(file) + ": {\n" + ",\n".join(lines) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    TABLE.write_text(table_text(), "utf-8")
