# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios of a large set: kept by their indices, and drawn again, to rounding, whenever they are looked at."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import overload

from scenario_gen.numerics import Ints
from scenario_gen.types import Scenario


class LazyScenarios(Sequence[Scenario]):
    """Eight bytes in memory for each scenario, however long it is and however many vehicles it has."""

    def __init__(
        self, redraw: Callable[[Sequence[int]], list[Scenario]], index: Ints, block: int
    ) -> None:
        """Take what draws them.

        Args:
            redraw: returns the scenarios of ascending indices that are of one block.
            index: (S,) of all scenarios.
            block: candidates that are drawn together; the first of a block has a multiple of it as index.
        """
        self._redraw, self._index, self._block = redraw, index, block

    def __len__(self) -> int:
        return len(self._index)

    @overload
    def __getitem__(self, at: int) -> Scenario: ...

    @overload
    def __getitem__(self, at: slice) -> "LazyScenarios": ...

    def __getitem__(self, at: int | slice) -> "Scenario | LazyScenarios":
        if isinstance(at, slice):
            return LazyScenarios(self._redraw, self._index[at], self._block)
        return self._redraw([int(self._index[at])])[0]

    def __iter__(self) -> Iterator[Scenario]:
        for _, together in groupby(
            (int(index) for index in self._index), lambda index: index // self._block
        ):
            yield from self._redraw(list(together))
