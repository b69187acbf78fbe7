"""What one request may ask for: an ego slot, start and end states; the chain that meets it, and the nearest that is possible."""

from scenario_gen.requests.chain import Chain
from scenario_gen.requests.nearest import ImpossibleError, Suggestion
from scenario_gen.requests.request import Request
from scenario_gen.requests.run import Outcome, run_request

__all__ = ["Chain", "ImpossibleError", "Outcome", "Request", "Suggestion", "run_request"]
