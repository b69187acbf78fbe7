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

"""Bags as rosbag2 writes them (MCAP, metadata version 9), in and out, without ROS."""

from scenario_gen.bags.reader import bag_topics, BagMessage, BagTopic, read_messages
from scenario_gen.bags.reindex import reindex
from scenario_gen.bags.run import add_runs, read_scenario_set, Run, run_messages, write_run
from scenario_gen.bags.writer import AtomicBag, BagWriter, Split

__all__ = [
    "AtomicBag",
    "BagMessage",
    "BagTopic",
    "BagWriter",
    "Run",
    "Split",
    "add_runs",
    "bag_topics",
    "read_messages",
    "read_scenario_set",
    "reindex",
    "run_messages",
    "write_run",
]
