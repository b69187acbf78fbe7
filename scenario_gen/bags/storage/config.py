# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bounds of reading a bag."""

from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters

_MESSAGE_COST_BYTES = 256
_MAX_GROWTH_RATIO = 100
"""Growth by decompression above which a file is suspicious; maps grow most, 10 to 50 times."""


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

    def __init__(
        self, config: BagConfig, bag: str, file_bytes: int, parameter: str = "bag.most_bytes"
    ) -> None:
        """Begin with nothing spent.

        Args:
            config: the bounds.
            bag: its name in messages.
            file_bytes: size of its files; they may decompress to 100 times that, or `most_bytes`.
            parameter: name of the parameter that sets `most_bytes`, for messages.
        """
        self.config = config
        self._bag = bag
        self._parameter = parameter
        self._decompressed_left = max(config.most_bytes, _MAX_GROWTH_RATIO * file_bytes)
        self._messages_left = config.most_bytes

    def spend_decompressed(self, count: int) -> None:
        """Count bytes that were decompressed or skipped.

        Raises:
            InputError: the bag decompresses to more than its size makes plausible.
        """
        self._decompressed_left -= count
        if self._decompressed_left < 0:
            raise InputError(
                f"{self._bag}: decompresses to more than {_MAX_GROWTH_RATIO} times its size and "
                f"more than {self._parameter} ({self.config.most_bytes} bytes), which is unusual "
                f"for a recording; raise {self._parameter} if the file is sound"
            )

    def spend_message(self, count: int) -> None:
        """Count a message of so many bytes that is passed on.

        Raises:
            InputError: the messages exceed `most_bytes`.
        """
        self._messages_left -= count + _MESSAGE_COST_BYTES
        if self._messages_left < 0:
            raise InputError(
                f"{self._bag}: its messages take more than {self._parameter} "
                f"({self.config.most_bytes} bytes); raise {self._parameter} if there is enough "
                "memory, or read fewer topics"
            )
