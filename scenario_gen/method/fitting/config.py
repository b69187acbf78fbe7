# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a template is placed on a road."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.fitting.kept import allowed_losses, LOSABLE


@dataclass(frozen=True)
class FittingConfig(Parameters):
    """Parameters of the fitting (paper III-A)."""

    placement: str = parameter(
        "auto",
        "how the recording is placed: in its own frame, on the road's lanes, or searched for on the grid",
        choices=("auto", "identity", "lanes", "search"),
    )
    allow: str = parameter(
        "",
        "what a fit may lose, with commas between: "
        + ", ".join(f"lost_{kind} ({what})" for kind, what in LOSABLE.items()),
    )
    scale_low: float = parameter(
        0.8, "smallest scale s of eq 9 that is accepted", low=0.01, high=1.0
    )
    scale_high: float = parameter(
        1.25, "largest scale s of eq 9 that is accepted", low=1.0, high=1000.0
    )
    max_move: float = parameter(
        3.0, "farthest that an anchor or a path may be moved", unit="m", low=0.0, high=100.0
    )
    clearance: float = parameter(
        0.5, "gap kept between the footprints of fitted vehicles", unit="m", low=0.0, high=5.0
    )
    margin: float = parameter(
        0.3, "room beside a footprint that the placement looks for", unit="m", low=0.0, high=5.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed_losses(self.allow)

    def accepts(self, scale: float) -> bool:
        """Return whether a scale s of eq 9 is near enough to one."""
        return self.scale_low <= scale <= self.scale_high
