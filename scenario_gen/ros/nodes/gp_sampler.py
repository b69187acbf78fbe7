# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""gp_sampler: road, tracks, changepoints, fit and routes of one template in; checked `scenarios` and their `scenarios/info` out.

It generates when the inputs are complete, on the action `~/generate_scenarios`, and on the service `~/generate`. Their parameters
are the node's own, valid for that request only, and `request`, the caller's name for it. /diagnostics says how far it is;
`~/cancel_request` ends one, `~/cancel` all.
"""

from collections.abc import Mapping
from functools import partial
import os
import threading

from msg_conventions.diagnostics import Level
from msg_conventions.lanes import TOPIC as LANES
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.method.sampling import Cancelled
from scenario_gen.ros.common.generate_action import action_type, Goals
from scenario_gen.ros.common.requests import (
    Answer,
    answer_request,
    Config,
    OpenRequest,
    OpenRequests,
)
from scenario_gen.ros.common.stage_node import Inputs, StageNode
from scenario_gen.ros.common.topics import unacknowledged
from scenario_gen.types import tokens

ENDS = ("road/entries", "road/exits")  # needed only for requests with start or end states


class GpSampler(StageNode):
    """Samples valid scenarios around the planned routes."""

    INPUTS = ("map", *ENDS, LANES, "tracks", "changepoints", "fit", "fit/info")
    STAGES = (
        "situation",
        "roads",
        "method.fitting",
        "method.routing",
        "method.sampling",
        "method.validity",
    )
    OUTPUTS = ("scenarios", "scenarios/info", "markers")
    THREADS = min(2, os.cpu_count() or 1)  # so that a small request need not wait for a large one

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("gp_sampler", Config(), namespace)
        paired = (
            "tracks",
            "changepoints",
            "fit",
            "fit/info",
            *(("map",) if self.config.pair_map else ()),
        )
        self.inputs = Inputs(paired, () if self.config.pair_map else ("map",), (LANES,))
        self._routes: set[str] = set()
        self._turn = threading.Lock()
        self._requests = OpenRequests(self)
        action = action_type()
        self._goals = Goals(self, self._requests, action) if action else None

    def stopped(self) -> None:
        """Forget the inputs: being latched, they come again."""
        self.inputs.clear()

    def destroy_node(self) -> None:
        """Withdraw the action, too."""
        if self._goals:
            self._goals.destroy()
        super().destroy_node()

    def update_diagnostics(self) -> None:
        """Report how far the request at work is."""
        super().update_diagnostics()
        self._requests.report()

    def received(self, topic: str, data: bytes) -> None:
        """Generate when everything is there."""
        self.inputs.put(topic, data)
        if topic == "tracks":
            self._follow(data)
        self._requests.look()
        config = self.config
        if (
            config.generate_on_input
            and (topic not in ENDS or config.moves)
            and not self.missing(config)
        ):
            messages = self.messages()
            self.work(
                "inputs", lambda cancelled: self._generate_on_input(messages, config, cancelled)
            )

    def missing(self, config: Config) -> list[str]:
        """The topics that a request still waits for."""
        ends = ENDS if config.moves and config.pair_map else ()
        return self.inputs.missing() or [topic for topic in ends if topic not in self.messages()]

    def messages(self) -> dict[str, bytes]:
        """The template's messages; entries, exits and lanes only if the fit was made with them."""
        messages = self.inputs.complete() or {}
        return {
            t: data
            for t, data in messages.items()
            if t not in (*ENDS, LANES) or self.inputs.named("fit/info", t)
        }

    def _follow(self, tracks: bytes) -> None:
        """Listen to the routes of the vehicles in the tracks, and no longer to those of others."""
        wanted = {
            vehicle_topic(name, "route")
            for name in tokens(v.id for v in decode_tracks(tracks).vehicles)
        }
        self.inputs.forget(self._routes - wanted)
        for topic in sorted(self._routes - wanted):
            self.ignore(topic)
        self.inputs.expect(wanted)
        self._routes = wanted
        for topic in sorted(wanted):
            self.listen(topic)

    def _generate_on_input(
        self, messages: Mapping[str, bytes], config: Config, cancelled: Cancelled
    ) -> None:
        self.generate(
            messages, self._requests.add(job="inputs", n_requested=config.count), config, cancelled
        )

    def given_up(self, messages: Mapping[str, bytes], cancelled: Cancelled) -> str:
        """Return why a request is given up; "" if it is not."""
        return (
            "given up: its inputs were replaced"
            if self.inputs.replaced(messages)
            else "cancelled"
            if cancelled()
            else ""
        )

    def generate(
        self,
        messages: Mapping[str, bytes],
        request: OpenRequest,
        config: Config,
        cancelled: Cancelled,
    ) -> Answer | None:
        """Sample, check and publish; the request's summary closes `scenarios/info`. None if it was given up before its end."""

        def stop() -> (
            bool
        ):  # also within a set, so that no scenario of an old map follows a new one
            return bool(self.given_up(messages, cancelled))

        level, words, more = Level.WARN, "", dict[str, str]()
        try:
            if stop():
                return None
            self._requests.begin(request)
            node, send = (
                self.get_fully_qualified_name(),
                partial(self.outputs.send_paced, stop=stop),
            )
            with self.outputs.paced(
                self.OUTPUTS[:2], config.patience, partial(self._report_pace, request.name)
            ):
                result, summary = answer_request(
                    messages, config, request, node, stop, send, self._turn
                )
            words = summary.status.message
            if summary.cancelled:
                words = f"{self.given_up(messages, cancelled)}: {words}"
                return None
            level = summary.status.level
            return result, summary
        except Exception as error:
            if not stop():
                level, words, more = Level.ERROR, str(error), {"error": type(error).__name__}
            raise
        finally:
            self._requests.end(
                request, level, words or self.given_up(messages, cancelled) or "cancelled", **more
            )

    def _report_pace(self, request: str, topic: str, count: int) -> None:
        self.status(
            Level.WARN,
            unacknowledged(self, topic, count),
            f"pace of {topic}",
            request=request,
            count=str(count),
        )
