"""The independent checker: valid at every instant, or refused with the cause (docs/validity.md)."""

from scenario_gen.validity.checker import Checker
from scenario_gen.validity.limits import Limits

__all__ = ["Checker", "Limits"]
