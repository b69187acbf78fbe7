# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Topics and messages of bags of any storage."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from scenario_gen.types import Quality


class BagMessage(NamedTuple):
    """A message of a bag: CDR bytes, and the time at which it was logged."""

    topic: str
    type: str
    data: bytes
    stamp_ns: int


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes:
        name: full name.
        type: "" if it has none.
        quality: offered by its first publisher.
        count: number of its messages.
        id: its number in one file.
        encoding: of its messages, in one file.
    """

    name: str
    type: str
    quality: Quality
    count: int
    id: int = 0
    encoding: str = "cdr"


class StoredFile(Protocol):
    """An open file of a bag.

    Attributes:
        topics: its topics.
        missing: a line that says what of it cannot be read; "" if it is whole.
    """

    topics: list[BagTopic]
    missing: str

    def messages(self, topics: Collection[BagTopic]) -> Iterator[BagMessage]:
        """Yield the messages of some of its topics by their stamps.

        Raises:
            InputError: the file is damaged, or larger than the bounds allow.
        """
        ...
