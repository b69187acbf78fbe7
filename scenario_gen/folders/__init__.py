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

"""Folders of results: whole or not at all, and in the place of nothing but an earlier result of the same kind."""

from scenario_gen.folders.disk import naming, sync, write_text
from scenario_gen.folders.marker import Kind, MARKER, sha256_of
from scenario_gen.folders.replace import replaced_folder
from scenario_gen.folders.scratch import scratch

__all__ = ["MARKER", "Kind", "naming", "replaced_folder", "scratch", "sha256_of", "sync", "write_text"]
