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

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import DIAGNOSTICS

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
    fields = [
        {
            "level": one.level,
            "name": one.name,
            "message": one.message,
            "values": [{"key": key, "value": value} for key, value in one.values.items()],
        }
        for one in statuses
    ]
    return encode(DIAGNOSTICS, stamp=stamp_ns, statuses=fields)


def decode_diagnostics(data: bytes, what: str = "diagnostics") -> tuple[int, tuple[Status, ...]]:
    """Return stamp [ns] and statuses.

    Raises:
        InputError: the message is damaged.
    """
    message = decode(DIAGNOSTICS, data, what)
    statuses = (
        Status(
            one.name,
            Level(min(one.level, Level.STALE)),
            one.message,
            {value.key: value.value for value in one.values},
        )
        for one in message.statuses
    )
    return message.stamp, tuple(statuses)


def decimal_stamp(stamp_ns: int) -> str:
    """Return a stamp as seconds and nine digits behind the point."""
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def of_template(status: Status, stamp_ns: int) -> Status:
    """Return a status with the stamp of the template that it is about, as the value `template_stamp`."""
    return replace(status, values={**status.values, TEMPLATE: decimal_stamp(stamp_ns)})


def template_of(status: Status, stamp_ns: int) -> int:
    """Return the stamp [ns] of the template that a status is about; by default `stamp_ns`, its message's."""
    seconds, point, rest = status.values.get(TEMPLATE, "").partition(".")
    is_stamp = (
        point
        and len(rest) == 9
        and (seconds + rest).isascii()
        and (seconds + rest).isdecimal()
        and len(seconds) < 20
    )
    return int(seconds + rest) if is_stamp else stamp_ns
