"""The paper's figures 2 to 5 on its own settings, each beside its claim and what we measure."""

from scenario_gen.reproduce.claims import Claim, claims_of
from scenario_gen.reproduce.measure import PaperCase, run_case
from scenario_gen.reproduce.page import PAGE, refusals, write_page
from scenario_gen.reproduce.run import reproduce

__all__ = ["PAGE", "Claim", "PaperCase", "claims_of", "refusals", "reproduce", "run_case", "write_page"]
