# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Exports for other software: CommonRoad, OpenSCENARIO, Autoware and ScenarioNet."""

from scenario_gen.output.exchange.cases import Case, Exported
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.export import export_bag, ExportFormat, Written

__all__ = ["Case", "ExportConfig", "ExportFormat", "Exported", "Written", "export_bag"]
