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

"""Raw files and bags -> encounters (paper II-A)."""

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import Quality
from scenario_gen.logs.read import encounters_of, LogResult, read_log
from scenario_gen.logs.streams import Sample, Streams

__all__ = ["LogConfig", "LogResult", "Quality", "Sample", "Streams", "encounters_of", "read_log"]
