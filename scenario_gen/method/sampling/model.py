# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The model of candidates: the clock that all share, the vehicles, and how their numbers hang together."""

from itertools import pairwise

import numpy as np

from scenario_gen.method.sampling.candidates import Batch, Scale, VehicleModel
from scenario_gen.method.sampling.joint import Mixing
from scenario_gen.method.sampling.time_warp import TimeWarp
from scenario_gen.method.sampling.window import Window
from scenario_gen.numerics import Floats
from scenario_gen.types import ReactionGraph

NOBODY = ReactionGraph((), ())
"""Nobody reacts to anybody."""


class CandidateModel:
    """Draws candidates of one encounter on its routes.

    Source: paper III-C.
    """

    def __init__(
        self,
        vehicles: tuple[VehicleModel, ...],
        warp: TimeWarp,
        reactions: ReactionGraph = NOBODY,
        window: Window | None = None,
    ) -> None:
        self.vehicles, self.warp, self.reactions, self.window = vehicles, warp, reactions, window
        self._parts = np.cumsum([warp.size] + [v.size for v in vehicles]).tolist()
        self._mixings: dict[Scale, Mixing] = {}

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return int(self._parts[-1]) + (0 if self.window is None else 2)

    def draw(self, eps: Floats, scale: Scale) -> Batch:
        """Candidates from independent numbers eps (S, size), their standard deviations multiplied by `scale`."""
        eps, of_window = eps[:, : self._parts[-1]], eps[:, self._parts[-1] :]
        z = self._mixing(scale).mixed(eps) if self.reactions.edges else eps
        clock = self.warp.sample(z[:, : self.warp.size], scale.time)
        drawn = [
            v.draw(z[:, a:b], scale, clock, self.warp.nominal)
            for v, (a, b) in zip(self.vehicles, pairwise(self._parts), strict=True)
        ]
        return Batch.of(
            self.vehicles, drawn, None if self.window is None else (self.window, of_window)
        )

    def _mixing(self, scale: Scale) -> Mixing:
        """The mixing at a scale, made once."""
        if scale not in self._mixings:
            self._mixings[scale] = Mixing.of(
                self.vehicles, self._parts, self.warp.nominal, self.reactions, scale
            )
        return self._mixings[scale]
