# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures of the naturalness benchmark: a template (bold) and its samples (thin) over each other. Needs matplotlib."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks._naturalness_generate import Made
from benchmarks._naturalness_motion import Signals

SHOWN = 12  # samples


def draw(made: Made, path: Path) -> None:
    """Draw speed, acceleration, lateral acceleration and yaw rate over time, a column per vehicle, and all paths below."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    if made.template is None:
        return
    template, samples = (
        Signals.of(made.template),
        [Signals.of(sample) for sample in made.samples[:SHOWN]],
    )
    vehicles = len(template.speed)
    figure, axes = plt.subplots(
        5, vehicles, figsize=(5.5 * vehicles, 14.0), squeeze=False, constrained_layout=True
    )
    rows = (("speed", "m/s"), ("acceleration", "m/s²"), ("lateral", "m/s²"), ("yaw_rate", "rad/s"))
    for n in range(vehicles):
        for axis, (name, unit) in zip(axes[:, n], rows, strict=False):
            for one, style in _layers(template, samples):
                values = getattr(one, name)[n]
                axis.plot(one.time[: len(values)], values, **style)
            axis.set_ylabel(f"{name} [{unit}]")
        axes[0, n].set_title(f"{made.name} on {made.road}, vehicle {n}", fontsize=9)
        for one, style in _layers(
            Signals.of(made.oracle) if made.oracle else template, samples
        ):  # fitted: on the road
            axes[4, n].plot(*one.position[n].T, **style)
        axes[4, n].set_aspect("equal", adjustable="datalim")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=60)
    plt.close(figure)


def _layers(
    template: Signals, samples: Sequence[Signals]
) -> list[tuple[Signals, dict[str, object]]]:
    thin = {"color": "tab:blue", "linewidth": 0.7, "alpha": 0.6}
    return [
        *((sample, thin) for sample in samples),
        (template, {"color": "black", "linewidth": 2.0}),
    ]
