# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The defaults of all stages as a parameter file: `python test/support/default_yaml.py > config/default.yaml`."""

import json
import re

from scenario_gen.base.parameters import flatten
from scenario_gen.method.config import PipelineConfig

DEFAULTS = """\
# Every parameter of the stages with its default, for the nodes (in any namespace) and for `scenario-gen --params`.
# A node takes those it declares and leaves the others alone.
# Written by: python test/support/default_yaml.py > config/default.yaml
/**:
  ros__parameters:
"""


def default_yaml() -> str:
    """Return the text of config/default.yaml, as YAML 1.1 reads it back: a real number always has a point."""
    lines, stage = [], ""
    for name, (entry, value) in flatten(PipelineConfig()).items():
        head, _, rest = name.partition(".")
        if head != stage:
            lines.append(f"    {head}:")
            stage = head
        text = json.dumps(value)
        text = (
            re.sub(r"^(-?\d+)(e[+-]?\d+)$", r"\1.0\2", text) if isinstance(value, float) else text
        )
        unit = f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
        lines += [f"      # {entry.metadata['meaning']}{unit}", f"      {rest}: {text}"]
    return DEFAULTS + "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(default_yaml(), end="")
