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

"""config/default.yaml, written from the declarations: `python -m scenario_gen.nodes.default_parameters > config/default.yaml`."""

import json
import re
from typing import Any

from scenario_gen.parameters import flatten
from scenario_gen.pipeline import PipelineConfig

HEAD = """\
# Every parameter of the stages with its default, for the nodes (in any namespace) and for `scenario-gen --params`.
# A node takes those it declares and leaves the others alone.
# Written by: python -m scenario_gen.nodes.default_parameters > config/default.yaml
/**:
  ros__parameters:
"""


def yaml_value(value: Any) -> str:
    """Return a value as YAML 1.1 reads it back: a real number always has a point."""
    text = json.dumps(value)
    return re.sub(r"^(-?\d+)(e[+-]?\d+)$", r"\1.0\2", text) if isinstance(value, float) else text


def default_yaml() -> str:
    """Return the text of config/default.yaml."""
    lines, stage = [], ""
    for name, (entry, value) in flatten(PipelineConfig()).items():
        head, _, rest = name.partition(".")
        if head != stage:
            lines.append(f"    {head}:")
            stage = head
        unit = f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
        lines += [f"      # {entry.metadata['meaning']}{unit}", f"      {rest}: {yaml_value(value)}"]
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(default_yaml(), end="")
