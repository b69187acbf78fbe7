# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reports ⇄ diagnostic_msgs/DiagnosticArray: key-values with full node names, one status per subject.

Used for `scenarios/info` (scenario_info.py), `road/info` and `fit/info` (hashes.py), `report` and `/diagnostics`.
`header.stamp` is the template's, but on /diagnostics the time of the message: there a status about a template bears its stamp as
the value `template_stamp`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

from msg_conventions.cdr import CdrReader, CdrWriter

TYPE = "diagnostic_msgs/msg/DiagnosticArray"
TEMPLATE = "template_stamp"


class Level(IntEnum):
    """diagnostic_msgs/DiagnosticStatus levels."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One diagnostic_msgs/DiagnosticStatus."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def encode_diagnostics(statuses: Sequence[Status], stamp_ns: int) -> bytes:
    """Return the statuses as CDR bytes."""
    writer = CdrWriter().header(stamp_ns, "").pack("I", len(statuses))
    for status in statuses:
        writer.pack("B", status.level).string(status.name).string(status.message).string("").pack("I", len(status.values))
        for key, value in status.values.items():
            writer.string(key).string(value)
    return writer.finish()


def decode_diagnostics(data: bytes, what: str = "diagnostics") -> tuple[int, tuple[Status, ...]]:
    """Return stamp [ns] and statuses.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, _ = reader.header()
    statuses = []
    for _ in range(reader.count()):
        level, name, message = reader.one("B"), reader.string(), reader.string()
        reader.string()  # hardware id
        values = {}
        for _ in range(reader.count()):
            key = reader.string()
            values[key] = reader.string()
        statuses.append(Status(name, Level(min(level, Level.STALE)), message, values))
    return stamp_ns, tuple(statuses)


def decimal_stamp(stamp_ns: int) -> str:
    """Return a stamp as seconds and nine digits behind the point."""
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def of_template(status: Status, stamp_ns: int) -> Status:
    """Return a status with the stamp of the template that it is about, as the value `template_stamp`."""
    return replace(status, values={**status.values, TEMPLATE: decimal_stamp(stamp_ns)})


def template_of(status: Status, stamp_ns: int) -> int:
    """Return the stamp [ns] of the template that a status is about; by default `stamp_ns`, its message's."""
    seconds, point, rest = status.values.get(TEMPLATE, "").partition(".")
    is_stamp = point and len(rest) == 9 and (seconds + rest).isascii() and (seconds + rest).isdecimal() and len(seconds) < 20
    return int(seconds + rest) if is_stamp else stamp_ns
