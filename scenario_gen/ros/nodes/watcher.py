# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""watcher: reports to the runner of a suite, on standard output, what the nodes have published and which errors they report."""

from rclpy.node import Node

from msg_conventions.diagnostics import decode_diagnostics, Level
from scenario_gen.ros.plumbing.start import say
from scenario_gen.ros.plumbing.topics import create_subscription

MILESTONES = ("tracks", "map", "changepoints", "fit")


class Watcher(Node):  # type: ignore[misc]
    """Watches one namespace; or, without one, /diagnostics, which belongs to all."""

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("watcher", namespace=namespace, enable_rosout=False, start_parameter_services=False)
        self._reported: dict[str, str] = {}  # by name: /diagnostics has all again every second
        if namespace is None:
            create_subscription(self, "/diagnostics", self._diagnostics)
            return
        for topic in MILESTONES:
            create_subscription(self, topic, lambda _, topic=topic: say(event="published", namespace=namespace, topic=topic))
        create_subscription(self, "scenarios/info", self._account)

    def autostart(self) -> None:
        """Nothing to start."""

    def _account(self, data: bytes) -> None:
        for status in decode_diagnostics(data)[1]:
            if "published" in status.values:
                published, requested = int(status.values["published"]), int(status.values["requested"])
                say(event="done", namespace=self.get_namespace(), published=published, requested=requested, text=status.message)

    def _diagnostics(self, data: bytes) -> None:
        for status in decode_diagnostics(data)[1]:
            if self._reported.get(status.name) == status.message and "recorded" not in status.name:
                continue
            self._reported[status.name] = status.message
            if "recorded" in status.name:
                say(event="recorded", counts={topic: int(count) for topic, count in status.values.items()})
            elif status.level >= Level.ERROR:
                say(event="error", name=status.name, text=status.message, kind=status.values.get("error", ""))
            elif "progress" in status.name and "request" in status.values:
                say(event="progress", name=status.name, text=status.message)
