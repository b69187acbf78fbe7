# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/gallery/*.png and write docs/gallery.md: `python docs/gallery.py` (bundled logs, built-in roads, seed 7)."""

from pathlib import Path

import matplotlib
from matplotlib import pyplot

from scenario_gen import (
    bundled,
    Encounter,
    generate,
    GenerationResult,
    InputError,
    read_log,
    RefusedError,
)

PAGE = Path(__file__).with_name("gallery.md")
PICTURES = PAGE.with_suffix("")
TUTORIAL = PAGE.parents[1] / "examples" / "my_log.csv"
ROADS = ("four_way", "t_intersection", "corridor", "straight", "curve")
CASES, COUNT, SEED = ("a", "b", "c"), 10, 7
HEAD = """# Gallery

What can be generated? Each picture shows scenarios of a bundled synthetic log on a built-in road. A dot is where a vehicle
starts, a colour is a vehicle. `python docs/gallery.py` draws this page.
"""


def main() -> None:
    """Draw each case on each road that it fits, and the tutorial's scenarios."""
    matplotlib.use("Agg")
    PICTURES.mkdir(exist_ok=True)
    parts = [HEAD]
    for case in CASES:
        log = bundled(case)
        (encounter,) = read_log(log).encounters
        drawn = {
            road: result
            for road in ROADS
            if (result := drawn_on(encounter, road, COUNT, f"{case}_{road}"))
        }
        words = "; ".join(sentences(next(iter(drawn.values()))))
        pictures = "".join(f"![{road}]({PICTURES.name}/{case}_{road}.png)\n" for road in drawn)
        roads = " ".join(f"--road {road}" for road in drawn)
        command = f"scenario-gen generate scenario_gen/resources/{log.name} {roads} --count {COUNT} --seed {SEED}"
        text = f"{words[:1].upper()}{words[1:]}."
        parts.append(
            f"## Case {case}: {', '.join(drawn)}\n\n{pictures}\n{text}\n\n```sh\n{command}\n```\n"
        )
    PAGE.write_text("\n".join(parts), encoding="utf-8")
    drawn_on(read_log(TUTORIAL).encounters[0], "four_way", 20, "tutorial")


def drawn_on(encounter: Encounter, name: str, count: int, picture: str) -> GenerationResult | None:
    """Draw scenarios of an encounter on a road; return them, or nothing if the road does not take it."""
    try:
        result = generate(encounter, name, count=count, seed=SEED)
    except (InputError, RefusedError) as error:
        print(f"{encounter.name}, {name}: {error}")
        return None
    figure, axes = pyplot.subplots(figsize=(4.4, 4.4), layout="constrained")
    result.plot(axes)
    figure.savefig(PICTURES / f"{picture}.png", dpi=70)
    pyplot.close(figure)
    return result


def sentences(result: GenerationResult) -> list[str]:
    """Return who reacts to whom, in words."""
    return [str(sentence) for sentence in result.reacting["sentences"]] or [
        "No reactions detected"
    ]


if __name__ == "__main__":
    main()
