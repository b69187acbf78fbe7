# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's figures 2 to 5 on its own settings, each beside its claim and what we measure."""

from scenario_gen.output.reproduce.claims import Claim, claims_of
from scenario_gen.output.reproduce.measure import PaperCase, run_case
from scenario_gen.output.reproduce.page import PAGE, refusals, reproduce, write_page

__all__ = ["PAGE", "Claim", "PaperCase", "claims_of", "refusals", "reproduce", "run_case", "write_page"]
