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

"""Two lengths of the tests: `make test` runs the short one, `make soak PART=tests` the long one."""

import os
from pathlib import Path

LONG = os.environ.get("SCENARIO_GEN_TESTS") == "long"
"""Whether this is the long form: also what is marked `long`, and larger counts."""

DATA = Path(os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
ENCOUNTERS = sorted((DATA / "trajectories").glob("*/encounter_*.csv"))
"""Every recorded encounter."""
_FIRST = {path.parent: path for path in reversed(ENCOUNTERS) if "platoon" not in path.name}
SOME_ENCOUNTERS = ENCOUNTERS if LONG else [*_FIRST.values()]
"""In the short form the first of each data set, with two to four vehicles; the platoon, the only one of its set, is too dear."""
