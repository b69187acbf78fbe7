# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hostile messages on every input of every node, then clients that call every service: all nodes live, stay small, and say why.

`SCENARIO_GEN_SOAK_MESSAGES` well-typed messages per input (10,000 unless given), one after the other: each that a decoder refuses
must be named on /diagnostics by every node that hears it. `SCENARIO_GEN_SOAK_MINUTES` of eight clients (30). What was measured
is kept in `state`.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
import json
import os
from pathlib import Path
import random
import threading
import time
from typing import Any

from figures import Figure, kept
from rosbags.typesys import get_typestore, Stores
from support.mutators import BYTES
from support.suite_processes import Client, memory, Processes, RESOURCES

from msg_conventions.cdr import CdrReader
from msg_conventions.diagnostics import decode_diagnostics, Level
from msg_conventions.streams import decode_fix, decode_speed, encode_fix, encode_speed
from msg_conventions.topics import topic_entry
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.base.ros_domain import free_domain
from scenario_gen.logs import read_log
from scenario_gen.ros.common.stage_node import refuse_damaged

MESSAGES = int(os.environ.get("SCENARIO_GEN_SOAK_MESSAGES", "10000"))
MINUTES = float(os.environ.get("SCENARIO_GEN_SOAK_MINUTES", "30"))
HEAD = 160  # bytes
CLIENTS, WARM_UP, GROWTH = 8, 1 / 3, 0.05  # a share of the time; of the memory then
GIBIBYTE, IDLE = (
    1 << 20,
    1.0,
)  # kB; s in which a machine with nothing else to do names what it refuses
STORE = get_typestore(Stores.ROS2_JAZZY)
NODES = {
    "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
    "segmenter": ["-p", "live.silence:=1.0"],
    "planner": [],
    "gp_sampler": ["-p", "count:=1"],
    "evaluator": [],
}
STREAMS: dict[str, Callable[[bytes, str], object]] = {"fix": decode_fix, "speed": decode_speed}
ROAD = ("planner", "gp_sampler")
LISTENERS = {
    "tracks": tuple(NODES),
    "map": ROAD,
    "road/entries": ROAD,
    "road/exits": ROAD,
    "road/info": ("planner",),
    "changepoints": (*ROAD, "evaluator"),
    "fit": ("gp_sampler",),
    "fit/info": ("gp_sampler",),
    "vehicle_1/route": ("gp_sampler",),
    "vehicle_1/fix": ("segmenter",),
    "vehicle_1/speed": ("segmenter",),
    "scenarios": ("evaluator",),
    "scenarios/info": ("evaluator",),
}


def hostile(rng: random.Random, kind: str, seeds: list[bytes]) -> bytes:
    """A damaged message that is still of its type: what any publisher of ROS could send."""
    while True:
        data = rng.choice(seeds)
        size = rng.choice(
            (HEAD, len(data))
        )  # what a message says of itself stands at its beginning
        head, rest = data[:size], data[size:]
        for _ in range(rng.choice((1, 1, 2, 4))):
            head = rng.choice(BYTES)(rng, head, seeds)
        try:
            return bytes(STORE.serialize_cdr(STORE.deserialize_cdr(head + rest, kind), kind))
        except Exception:  # whatever a decoder says of bytes that are not of the type
            continue


def is_refused(topic: str, data: bytes) -> bool:
    """Say whether a node refuses a message as it arrives; scenarios and accounts it judges later, together."""
    stream = STREAMS.get(topic.rpartition("/")[2])
    try:
        if stream:
            stream(data, topic)
        else:
            refuse_damaged(topic, data)
    except ScenarioGenError:
        return True
    return False


class Suite:
    """The nodes at work on a good encounter, a client, and seeds of all that they said."""

    def __init__(self, folder: Path, domain: int) -> None:
        (self.good,) = read_log(RESOURCES / "synthetic_c").encounters
        self.client = Client(domain)
        self.client.hear(
            "/diagnostics",
            "/report",
            *(f"/{topic}" for topic in LISTENERS if not topic.endswith(("fix", "speed"))),
        )
        self.made = Processes(folder, domain, NODES)
        self._served = 0
        self.serve()
        self.seeds = {topic: list(self.client.heard[f"/{topic}"]) for topic in LISTENERS}
        self.seeds["vehicle_1/fix"] = [encode_fix(42.0, -83.0, 10**18, "a")]
        self.seeds["vehicle_1/speed"] = [encode_speed(8.3, 10**18, "a")]

    def serve(self) -> None:
        """Say good tracks of a new stamp, and wait until the whole chain has dealt with them."""
        self._served += 1
        stamp = self.good.start_ns + self._served * 10**9
        self.client.say("/tracks", encode_tracks(replace(self.good, start_ns=stamp)))

        def is_reported() -> bool:
            return any(
                CdrReader(data, "report").stamp() == stamp
                for data in list(self.client.heard["/report"])
            )

        self.client.until(is_reported, f"the report of good tracks {self._served}", 300.0)

    def is_named(self, topic: str, after: int) -> set[str]:
        """The nodes that have said an error of the topic since so many messages of /diagnostics."""
        statuses = [
            s
            for data in self.client.heard["/diagnostics"][after:]
            for s in decode_diagnostics(data)[1]
        ]
        named = {s.name for s in statuses if s.level is Level.ERROR}
        return {
            node
            for node in LISTENERS[topic]
            if {f"/{node}: {topic}", f"/{node}: /{topic}"} & named
        }

    def end(self) -> dict[str, int]:
        """End the nodes; return their exit codes."""
        codes = self.made.end()
        self.client.close()
        return codes


def storm(suite: Suite, topic: str, rng: random.Random) -> dict[str, Any]:
    """Send hostile messages on one topic; return how many were refused, who was silent, and how long the slowest took."""
    kind, _ = topic_entry(topic)
    client, refused, silent, slowest = suite.client, 0, 0, 0.0
    client.announce(f"/{topic}")
    client.until(
        lambda: client.node.count_subscribers(f"/{topic}") >= len(LISTENERS[topic]),
        f"listeners of {topic}",
    )
    last = b""
    for _ in range(MESSAGES):
        data = hostile(rng, kind, suite.seeds[topic])
        if data == last:  # of a latched topic, the same word for word is no news
            continue
        last, after, began = data, len(client.heard["/diagnostics"]), time.monotonic()
        client.say(f"/{topic}", data)
        if not is_refused(topic, data):
            continue
        refused += 1
        try:
            client.until(
                lambda after=after: suite.is_named(topic, after) == set(LISTENERS[topic]),
                f"a refusal on {topic}",
                30.0,
            )
        except AssertionError:
            silent += 1
        slowest = max(slowest, time.monotonic() - began)
        del client.heard["/diagnostics"][:-1000]
    del client.heard[f"/{topic}"][:]
    served = False
    with suppress(AssertionError):
        suite.serve()
        served = True
    peaks = {node: memory(pid, "VmHWM") for node, pid in suite.made.pids.items()}
    return {
        "refused": refused,
        "silent": silent,
        "slowest": slowest,
        "served": served,
        "peaks": peaks,
    }


def _storms(state: Path) -> Iterator[Figure]:
    file = state / f"messages_{MESSAGES}.json"
    found: dict[str, dict[str, Any]] = json.loads(file.read_text()) if file.exists() else {}
    codes = dict.fromkeys(NODES, 0)
    left = [topic for topic in LISTENERS if topic not in found]
    if left:
        with free_domain() as domain:
            suite = Suite(state, domain)
            for topic in left:
                found[topic] = storm(suite, topic, random.Random(topic))
                file.write_text(json.dumps(found, indent=1))
                print(topic, found[topic], flush=True)
            codes = suite.end()
    asked = f"named on /diagnostics by every listener; idle within {IDLE:g} s; the next good tracks served"
    for topic, one in found.items():
        seen = (
            f"{one['refused']} refused, {one['silent']} not named, slowest {one['slowest']:.2f} s"
        )
        seen += "" if one["served"] else "; good tracks NOT served"
        yield Figure(
            f"{MESSAGES:,} hostile messages on {topic}",
            asked,
            seen,
            one["silent"] == 0 and one["served"],
        )
    peaks = {node: max(one["peaks"].get(node, 0) for one in found.values()) for node in NODES}
    seen = ", ".join(f"{node} {peak / 1024:.0f} MiB" for node, peak in peaks.items())
    is_small = all(0 < peak < GIBIBYTE for peak in peaks.values()) and not any(codes.values())
    yield Figure("every node lives, in", "less than 1 GiB each, exit code 0", seen, is_small)


def _calls(rng: random.Random, suite: Suite) -> list[tuple[Any, str, Callable[[], Any]]]:
    """Services with requests to make, good and bad."""
    from nav_msgs.srv import GetMap, GetPlan, LoadMap
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter
    from std_srvs.srv import Trigger

    def generate() -> Any:
        values = rng.choice(
            (
                {"count": 1},
                {"count": 2, "seed": rng.randrange(99)},
                {"count": -1},
                {"ego": "1"},
                {"no_such": 1},
            )
        )
        parameters = [
            Parameter(key, value=value).to_parameter_msg() for key, value in values.items()
        ]
        return SetParametersAtomically.Request(parameters=parameters)

    def plan() -> Any:
        request = GetPlan.Request(tolerance=rng.choice((0.0, -1.0, float("nan"))))
        start, goal = suite.good.position[0, 0], suite.good.position[0, -1]
        for stamped, point in ((request.start, start), (request.goal, goal)):
            stamped.header.frame_id = rng.choice(("map", "map", "elsewhere"))
            stamped.pose.position.x, stamped.pose.position.y = float(point[0]), float(point[1])
        return request

    return [
        (SetParametersAtomically, "/gp_sampler/generate", generate),
        (SetParametersAtomically, "/gp_sampler/generate", generate),
        (Trigger, "/gp_sampler/cancel", Trigger.Request),
        (GetPlan, "/planner/get_plan", plan),
        (GetMap, "/road_server/get_map", GetMap.Request),
        (
            LoadMap,
            "/road_server/load_map",
            lambda: LoadMap.Request(map_url=rng.choice(("straight", "corridor", "nonsense"))),
        ),
        (Trigger, "/segmenter/segment", Trigger.Request),
    ]


def _clients(state: Path) -> Iterator[Figure]:
    found = kept(state / f"clients_{MINUTES:g}.json", partial(_call_all, state))
    seen = f"{found['answered']:,} answers, {found['unanswered']} without one"
    yield Figure(
        f"{CLIENTS} clients for {MINUTES:g} min",
        "every call is answered",
        seen,
        found["unanswered"] == 0,
    )
    growth = {node: found["last"][node] / max(found["warm"][node], 1) - 1.0 for node in NODES}
    seen = ", ".join(
        f"{node} {found['warm'][node] / 1024:.0f} MiB {100 * share:+.1f} %"
        for node, share in growth.items()
    )
    yield Figure(
        "memory after the warm-up",
        f"at most {100 * GROWTH:g} % more",
        seen,
        max(growth.values()) <= GROWTH,
    )


def _fill_history(suite: Suite) -> None:
    """Have as many scenarios published as late joiners get: what the sampler keeps of them is no growth later."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    parameters = [Parameter("count", value=topic_entry("/scenarios")[1].depth).to_parameter_msg()]
    request = SetParametersAtomically.Request(parameters=parameters)
    assert suite.client.call(
        SetParametersAtomically, "/gp_sampler/generate", request, 600.0
    ).result.successful


def _call_all(state: Path) -> dict[str, Any]:
    with free_domain() as domain:
        suite = Suite(state, domain)
        found = _call_suite(suite, domain)
        suite.end()
    return found


def _call_suite(suite: Suite, domain: int) -> dict[str, Any]:
    _fill_history(suite)
    began, seconds, count = time.monotonic(), MINUTES * 60.0, {"answered": 0, "unanswered": 0}

    def work(seed: int) -> None:
        rng, client = random.Random(seed), Client(domain)
        calls = _calls(rng, suite)
        while time.monotonic() - began < seconds:
            kind, name, request = rng.choice(calls)
            try:
                client.call(kind, name, request(), 120.0)
                count["answered"] += 1
            except AssertionError:
                count["unanswered"] += 1
        client.close()

    threads = [threading.Thread(target=partial(work, seed)) for seed in range(CLIENTS)]
    for thread in threads:
        thread.start()
    warm: dict[str, int] = {}
    while any(thread.is_alive() for thread in threads):
        time.sleep(1.0)
        for messages in list(suite.client.heard.values()):
            messages.clear()
        if (
            time.monotonic() - began < WARM_UP * seconds
        ):  # the most in the warm-up: a set in the making is no growth
            for node, pid in suite.made.pids.items():
                warm[node] = max(warm.get(node, 0), memory(pid, "VmRSS"))
    return {
        **count,
        "warm": warm,
        "last": {node: memory(pid, "VmRSS") for node, pid in suite.made.pids.items()},
    }


def run(state: Path) -> Iterator[Figure]:
    """Measure what has not been measured yet."""
    yield from _storms(state)
    yield from _clients(state)
