# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bounds of reading a bag."""

from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters

MESSAGE_BYTES = 256  # that a message costs beside its own
FOUND_BYTES = 1024  # that finding a message in a chunk counts for: a chunk of few bytes may hold very many messages
SHRINK = 100  # times that a file may grow by decompression before it is suspected; maps shrink most, 10 to 50 times


@dataclass(frozen=True)
class BagConfig(Parameters):
    """Bounds of reading a bag, so that a small damaged or malicious file cannot take all memory."""

    most_bytes: int = parameter(
        512 * 1024**2,
        "most bytes of messages that are read from one bag, 256 beside its own for each",
        low=1,
        high=2**62,
    )
    most_chunk_bytes: int = parameter(
        64 * 1024**2,
        "largest chunk of an MCAP file after decompression, largest message of a SQLite file",
        low=1,
        high=2**31 - 1,
    )


class Allowance:
    """Counts the bytes that reading one bag takes, and refuses too many."""

    def __init__(
        self, config: BagConfig, what: str, file_bytes: int, bound: str = "bag.most_bytes"
    ) -> None:
        """Start with nothing counted.

        Args:
            config: the bounds.
            what: names the bag in messages.
            file_bytes: size of its files; decompressed they may be 100 times that, or `most_bytes`.
            bound: the parameter that `most_bytes` came from, for messages.
        """
        self.config = config
        self._what = what
        self._bound = bound
        self._unpacked = max(config.most_bytes, SHRINK * file_bytes)
        self._held = config.most_bytes

    def unpack(self, count: int) -> None:
        """Count bytes that were decompressed or passed over.

        Raises:
            InputError: there are too many for the size of the file.
        """
        self._unpacked -= count
        if self._unpacked < 0:
            raise InputError(
                f"{self._what}: decompresses to more than {SHRINK} times its size and more than {self._bound} "
                f"({self.config.most_bytes} bytes), as no recording does; set {self._bound} if it is one"
            )

    def hold(self, count: int) -> None:
        """Count a message that is passed on.

        Raises:
            InputError: there are too many.
        """
        self._held -= count + MESSAGE_BYTES
        if self._held < 0:
            raise InputError(
                f"{self._what}: its messages take more than {self._bound} ({self.config.most_bytes} bytes); set {self._bound} if "
                "there is memory for more, or read fewer topics"
            )
