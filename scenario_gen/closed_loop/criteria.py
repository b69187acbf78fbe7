# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Criteria: further conditions that a drive must meet, from packages or from the user's module."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
import math
import re
from typing import Any, Protocol

from scenario_gen.base.errors import describe, did_you_mean, InputError
from scenario_gen.base.registry import load_class, Registry
from scenario_gen.closed_loop.drive import Drive

_TEXT = re.compile(r"\s*([^<>]+?)\s*(?:([<>])\s*([-+.\deE]+)\s*)?")


class Criterion(Protocol):
    """A condition on a drive, which misses it if the value is below the threshold.

    Attributes:
        name: display name.
        threshold: in the unit of the value.

    A criterion with the attribute `greater_is_better = False` is missed above the threshold.
    """

    name: str
    threshold: float

    def __call__(self, drive: Drive) -> float:
        """Return the value of a drive; NaN if it does not exist, which misses nothing."""


CRITERIA: Registry[Callable[[], Criterion]] = Registry("scenario_gen.criteria", {})


@dataclass(frozen=True)
class CriterionResult:
    """The value of one criterion for one drive.

    Attributes:
        name: name of the criterion.
        value: NaN if it does not exist.
        threshold: in the unit of the value.
        greater_is_better: whether values below the threshold miss it, else values above it.
    """

    name: str
    value: float
    threshold: float
    greater_is_better: bool

    @property
    def margin(self) -> float:
        """Distance of the value to the threshold, negative if the drive misses the criterion."""
        distance = self.value - self.threshold
        return distance if self.greater_is_better else -distance

    @property
    def missed(self) -> bool:
        """Whether the drive misses the criterion."""
        return self.margin < 0.0

    def __str__(self) -> str:
        side = "below" if self.greater_is_better else "above"
        return f"{self.name} {self.value:.3g}, {side} {self.threshold:g}"


@dataclass(frozen=True)
class CheckedCriterion:
    """A criterion whose attributes have been checked; the fields are as in `CriterionResult`."""

    name: str
    threshold: float
    greater_is_better: bool
    measure: Callable[[Drive], float]

    def __call__(self, drive: Drive) -> CriterionResult:
        """Return the result of a drive.

        Raises:
            InputError: the criterion fails, or returns no number.
        """
        try:
            value = float(self.measure(drive))
        except (Exception, SystemExit) as error:
            raise InputError(f"criterion {self.name!r} failed: {describe(error)}") from error
        return CriterionResult(self.name, value, self.threshold, self.greater_is_better)


@lru_cache(maxsize=64)
def find_criteria(texts: str) -> tuple[CheckedCriterion, ...]:
    """Return the criteria of a list such as `clearance, my_module:Comfort<0.5`.

    A number after the name replaces the threshold.

    Raises:
        InputError: a criterion is not found or not valid, or two have one name.
    """
    criteria = tuple(_find(text) for text in texts.split(",") if text.strip())
    names = [criterion.name for criterion in criteria]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"criteria {texts}: two have the name {name!r}; rename one")
    return criteria


def _find(text: str) -> CheckedCriterion:
    """Return one criterion of a list."""
    match = _TEXT.fullmatch(text)
    if match is None:
        raise InputError(f"criterion {text!r}: write it as NAME or MODULE:CLASS, or e.g. NAME<0.5")
    name, sign, limit = match.groups()
    if ":" not in name and name not in CRITERIA:
        near = did_you_mean(name, CRITERIA.names())
        raise InputError(
            f"criterion {name!r} is not installed; write MODULE:CLASS for your own class{near}"
        )
    make: Any = load_class("criterion", name) if ":" in name else CRITERIA[name]
    try:
        criterion = make()
        number = float(criterion.threshold if limit is None else limit)
        better = bool(getattr(criterion, "greater_is_better", True))
        is_valid = callable(criterion) and isinstance(criterion.name, str) and criterion.name
    except (Exception, SystemExit) as error:
        raise InputError(f"criterion {text}: {describe(error)}") from error
    if not is_valid or not math.isfinite(number):
        raise InputError(
            f"criterion {text}: the class needs `name` (text), `threshold` (finite number) "
            "and `__call__(drive)`"
        )
    if sign and (sign == "<") != better:
        other = "<" if better else ">"
        raise InputError(f"criterion {text}: write {other}, the side on which a drive misses it")
    return CheckedCriterion(criterion.name, number, better, criterion)
