# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bounds of reading a bag."""

from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters

_MESSAGE_COST_BYTES = 256


@dataclass(frozen=True)
class BagConfig(Parameters):
    """Bounds of reading a bag, so that a small damaged or malicious file cannot use all memory."""

    most_bytes: int = parameter(
        512 * 1024**2,
        "largest total size of the messages read from one bag; each counts 256 bytes extra",
        low=1,
        high=2**62,
    )
    most_chunk_bytes: int = parameter(
        64 * 1024**2,
        "largest chunk of an MCAP file after decompression, largest message of a SQLite file",
        low=1,
        high=2**31 - 1,
    )


class ReadBudget:
    """Counts the bytes that reading one bag costs, and refuses to exceed the bounds."""

    def __init__(self, config: BagConfig, bag: str, parameter: str = "bag.most_bytes") -> None:
        """Begin with nothing spent.

        Args:
            config: the bounds.
            bag: its name in messages.
            parameter: name of the parameter that sets `most_bytes`, for messages.
        """
        self.config = config
        self._bag = bag
        self.parameter = parameter
        self._messages_left = config.most_bytes

    def spend_message(self, count: int) -> None:
        """Count a message of so many bytes that is passed on.

        Raises:
            InputError: the messages exceed `most_bytes`.
        """
        self._messages_left -= count + _MESSAGE_COST_BYTES
        if self._messages_left < 0:
            raise InputError(
                f"{self._bag}: its messages take more than {self.parameter} "
                f"({self.config.most_bytes} bytes); raise {self.parameter} if there is enough "
                "memory, or read fewer topics"
            )
