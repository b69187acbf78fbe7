# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reports ⇄ diagnostic_msgs/DiagnosticArray: one status with key-values per node and subject.

Used for `report`, `verdicts` and `/diagnostics`. `header.stamp` is the template's stamp. On
/diagnostics it is the time of the message, and a status about a template has the template's stamp
as the value `template_stamp`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum

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


class Subject(StrEnum):
    """Subjects of statuses that other processes read."""

    PROGRESS = "progress"
    RECORDED = "recorded"


@dataclass(frozen=True)
class Status:
    """One diagnostic_msgs/DiagnosticStatus.

    Its name is the node's full name, a colon and the subject.
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)

    @property
    def node(self) -> str:
        """The full name of the node that reports it."""
        return self.name.partition(": ")[0]

    @property
    def subject(self) -> str:
        """The subject, such as `fit`, or `fit of 7` for vehicle 7."""
        return self.name.partition(": ")[2]


def encode_diagnostics(statuses: Sequence[Status], stamp_ns: int) -> bytes:
    """Return the statuses as CDR bytes."""
    fields = [
        {
            "level": status.level,
            "name": status.name,
            "message": status.message,
            "values": [{"key": key, "value": value} for key, value in status.values.items()],
        }
        for status in statuses
    ]
    return encode(DIAGNOSTICS, stamp=stamp_ns, statuses=fields)


def decode_diagnostics(data: bytes, source: str = "diagnostics") -> tuple[int, tuple[Status, ...]]:
    """Return stamp [ns] and statuses.

    Raises:
        InputError: the message is damaged.
    """
    message = decode(DIAGNOSTICS, data, source)
    statuses = (
        Status(
            status.name,
            Level(min(status.level, Level.STALE)),
            status.message,
            {entry.key: entry.value for entry in status.values},
        )
        for status in message.statuses
    )
    return message.stamp, tuple(statuses)


def decimal_stamp(stamp_ns: int) -> str:
    """Return a stamp as seconds with nine decimals."""
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def of_template(status: Status, stamp_ns: int) -> Status:
    """Return a status with its template's stamp as the value `template_stamp`."""
    return replace(status, values={**status.values, TEMPLATE: decimal_stamp(stamp_ns)})
