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

"""watcher: tells the runner of a suite, on standard output, what the nodes have published and what they complain of."""

import sys

from rclpy.node import Node

from msg_conventions.diagnostics import decode_diagnostics, Level
from msg_conventions.topics import topic_entry
from scenario_gen.nodes.base import run_nodes
from scenario_gen.nodes.forked import say
from scenario_gen.nodes.message_classes import message_class
from scenario_gen.nodes.voice import qos

MILESTONES = ("tracks", "map", "changepoints", "fit")


class Watcher(Node):  # type: ignore[misc]
    """Watches one namespace; /diagnostics, which belongs to all, is watched without one."""

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("watcher", namespace=namespace, enable_rosout=False, start_parameter_services=False)
        self._said: dict[str, str] = {}  # by name: /diagnostics says all again every second
        if namespace is None:
            self._listen("/diagnostics", self._diagnostics)
            return
        for topic in MILESTONES:
            self._listen(topic, lambda _, topic=topic: say(event="published", namespace=namespace, topic=topic))
        self._listen("scenarios/info", self._account)

    def autostart(self) -> None:
        """Nothing to start."""

    def _listen(self, topic: str, callback: object) -> None:
        kind, quality = topic_entry(topic)
        self.create_subscription(message_class(kind), topic, callback, qos(quality), raw=True)

    def _account(self, data: bytes) -> None:
        for status in decode_diagnostics(data)[1]:
            if "published" in status.values:
                published, requested = int(status.values["published"]), int(status.values["requested"])
                say(event="done", namespace=self.get_namespace(), published=published, requested=requested, text=status.message)

    def _diagnostics(self, data: bytes) -> None:
        for status in decode_diagnostics(data)[1]:
            if self._said.get(status.name) == status.message and "recorded" not in status.name:
                continue
            self._said[status.name] = status.message
            if "recorded" in status.name:
                say(event="recorded", counts={topic: int(count) for topic, count in status.values.items()})
            elif status.level >= Level.ERROR:
                say(event="error", name=status.name, text=status.message, kind=status.values.get("error", ""))
            elif "progress" in status.name and "request" in status.values:
                say(event="progress", name=status.name, text=status.message)


def main() -> None:
    """Run the watcher: one node per namespace, and one for all."""
    every = ["", *sys.argv[2::2]]
    arguments = [word for name in every for word in ("--namespace", name)]
    sys.exit(run_nodes(Watcher, ["watcher", *arguments]))
