"""Changepoints -> the target road (paper III-A, eqs 7-9 put right)."""

from scenario_gen.fitting.config import FittingConfig
from scenario_gen.fitting.fit import fit_template
from scenario_gen.fitting.oracle import fitted_template
from scenario_gen.fitting.result import Fit, FittedVehicle

__all__ = ["Fit", "FittedVehicle", "FittingConfig", "fit_template", "fitted_template"]
