# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The calls of examples/service_calls.sh: read as `ros2 service call` reads them, sent to real nodes, answered as it says."""

import array
from collections.abc import Iterator
from dataclasses import dataclass
import importlib
from itertools import pairwise
import os
from pathlib import Path
import re
import shlex
import time
from typing import Any

import pytest
from support.suite_processes import Processes, RESOURCES
import yaml

from msg_conventions.diagnostics import Level

pytestmark = pytest.mark.dds
ROOT = Path(__file__).resolve().parents[2]
CALLS = (ROOT / "examples" / "service_calls.sh").read_text(encoding="utf-8")
LOG = RESOURCES / "synthetic_c"
NODES = {
    "log_player": ["-p", f"log_path:={LOG}"],
    "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
    "segmenter": ["-p", "seed:=7", "-p", "live.listen:=false"],  # not to what the player plays
    "planner": ["-p", "seed:=7"],
    "gp_sampler": ["-p", "count:=3", "-p", "seed:=7"],
    "recorder": [],
    "player": ["-p", f"bag:={LOG}", "-p", "paused:=true", "-p", "rate:=0.01"],
}


@dataclass(frozen=True)
class Call:
    """A call, and the answer below it."""

    name: str
    type: str
    request: dict[str, Any]
    answer: dict[str, Any]

    @property
    def kind(self) -> Any:
        package, folder, name = self.type.split("/")
        return getattr(importlib.import_module(f"{package}.{folder}"), name)

    def made(self) -> Any:
        """The request as `ros2 service call` makes it."""
        request = self.kind.Request()
        fill(request, self.request)
        return request


def calls() -> Iterator[Call]:
    for line, below in pairwise(CALLS.splitlines()):
        if line.startswith("ros2 service call"):
            _, _, _, name, kind, *more = shlex.split(line)
            assert below.startswith("# {"), f"no answer below {line}"
            yield Call(
                name, kind, yaml.safe_load(more[0]) if more else {}, yaml.safe_load(below[2:])
            )


def fill(message: Any, values: dict[str, Any]) -> None:
    """Set a message's fields: rosidl_runtime_py's way where it is installed, as it is with ros2cli, else the same rules."""
    try:
        from rosidl_runtime_py.set_message import set_message_fields
    except ImportError:
        _fill(message, values)
    else:
        set_message_fields(message, values)


def _fill(message: Any, values: dict[str, Any]) -> None:
    kinds = message.get_fields_and_field_types()
    for name, value in values.items():
        assert name in kinds, f"{type(message).__name__} has no field {name}"
        field = getattr(message, name)
        if hasattr(field, "get_fields_and_field_types"):
            _fill(field, value)
        elif isinstance(field, list) and (
            element := re.fullmatch(r"sequence<(\w+)/(\w+)>", kinds[name])
        ):
            kind = getattr(importlib.import_module(f"{element[1]}.msg"), element[2])
            made = [kind() for _ in value]
            for one, entry in zip(made, value, strict=True):
                _fill(one, entry)
            setattr(message, name, made)
        elif isinstance(field, array.array):
            setattr(message, name, array.array(field.typecode, value))
        else:
            setattr(message, name, value if type(value) is type(field) else type(field)(value))


def differences(answer: Any, wanted: Any, where: str = "") -> list[str]:
    """Where a message is not as a page says; `…` in a text stands for any other."""
    if isinstance(wanted, dict):
        return [
            text
            for key, value in wanted.items()
            for text in differences(getattr(answer, key), value, f"{where}.{key}")
        ]
    if isinstance(wanted, str):
        pattern = ".*".join(map(re.escape, wanted.split("…")))
        return (
            []
            if re.fullmatch(pattern, answer, re.DOTALL)
            else [f"{where}: {answer!r} is not {wanted!r}"]
        )
    return [] if answer == wanted else [f"{where}: {answer!r} is not {wanted!r}"]


def test_every_listed_service_is_called():
    page = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    services = page.partition("## Services\n\n")[2].partition("\n\n")[0]
    listed = {
        name
        for row in re.findall(r"^- (`.*?) \(", services, re.MULTILINE)
        for name in re.findall(r"`([\w/]+)`", row)
    }
    assert len(listed) > 10
    assert {call.name.lstrip("/") for call in calls()} == listed
    for call in calls():
        call.made()


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    folder, before = tmp_path_factory.mktemp("calls"), Path.cwd()
    os.chdir(folder)  # a recorder that is given no name makes its bag there
    try:
        made = Processes(folder, domain, NODES)
    finally:
        os.chdir(before)
    yield made
    assert made.end() == dict.fromkeys(NODES, 0)


def test_service_calls_are_answered(suite, client):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.serialization import deserialize_message

    client.hear("/scenarios/info", "/diagnostics")
    client.wait("/scenarios/info", 4)  # the nodes' own request
    echo = re.search(r"topic echo /diagnostics --filter \"(.*)\"", CALLS)[1]

    def large_is_at_work() -> bool:
        messages = [
            deserialize_message(data, DiagnosticArray)
            for data in list(client.heard["/diagnostics"])
        ]
        shown = [m for m in messages if eval(echo, {"m": m})]
        pairs = [
            {pair.key: pair.value for pair in s.values}
            for m in shown
            for s in m.status
            if s.name.endswith("progress")
        ]
        return any(
            values.get("request") == "large" and int(values["accepted"]) > 0 for values in pairs
        )

    later, wrong, begun = [], [], time.monotonic()
    for call in calls():
        if "large: cancelled" in str(call.answer):
            later.append((call, client.call_later(call.kind, call.name, call.made())))
            client.until(large_is_at_work, "progress of the large request")
            continue
        wrong += [
            f"{call.name}{text}"
            for text in differences(client.call(call.kind, call.name, call.made()), call.answer)
        ]
        if call.name == "/gp_sampler/cancel_request":
            for asked, future in later:
                client.until(future.done, "the answer of what was cancelled")
                wrong += [
                    f"{asked.name}{text}" for text in differences(future.result(), asked.answer)
                ]
    assert wrong == []
    assert len(later) == 1
    errors = {s.name for s in client.statuses() if s.level is Level.ERROR}
    assert {"/road_server: load_map", "/planner: get_plan"} <= errors
    assert [path.is_dir() for path in suite.folder.glob("bag_*")] == [True]
    lines = [line for line in suite.log("gp_sampler").splitlines() if "request large:" in line]
    assert len(lines) < 10 + time.monotonic() - begun, (
        "about a line for a second, not one for each scenario"
    )
