# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/gallery/*.png and write docs/gallery.md: `python docs/gallery.py` (bundled logs, built-in roads, seed 7)."""

from pathlib import Path

from picture import draw, draw_road, pyplot

from scenario_gen import build_road, bundled, generate, GenerationResult, InputError, read_log, RefusedError

PAGE = Path(__file__).with_name("gallery.md")
PICTURES = PAGE.with_suffix("")
ROADS = ("four_way", "t_intersection", "corridor", "straight", "curve")
CASES, COUNT, SEED, MOST = ("a", "b", "c"), 10, 7, 12
HEAD = """# Gallery

What can be generated? Each picture shows scenarios of a bundled synthetic log on a built-in road.
A dot is a start, a colour a vehicle. `python docs/gallery.py` draws this page.
"""


def main() -> None:
    """Draw each case on each road that it fits, at most twelve."""
    PICTURES.mkdir(exist_ok=True)
    parts = [HEAD]
    for case in CASES:
        log = bundled(case)
        (encounter,) = read_log(log).encounters
        for name in ROADS:
            if len(parts) > MOST:
                break
            try:
                road = build_road(name, encounter)
                result = generate(encounter, road, count=COUNT, seed=SEED)
            except (InputError, RefusedError) as error:
                print(f"case {case}, {name}: {error}")
                continue
            figure, axes = pyplot.subplots(figsize=(4.0, 4.0), layout="constrained")
            for scenario in result.generated.scenarios:
                draw(axes, scenario, 0.5)
            draw_road(axes, road)
            axes.set_aspect("equal")
            axes.set(xlabel="x [m]", ylabel="y [m]")
            figure.savefig(PICTURES / f"{case}_{name}.png", dpi=70)
            pyplot.close(figure)
            words = "; ".join(told(result))
            words = words[:1].upper() + words[1:]
            place = f"scenario_gen/resources/{log.name}"
            picture = f"![{len(result.generated.scenarios)} scenarios]({PICTURES.name}/{case}_{name}.png)"
            parts.append(
                f"## Case {case}, {name}\n\n{picture}\n\n{words}.\n\n"
                f"```sh\nscenario-gen generate {place} --road {name} --count {COUNT} --seed {SEED}\n```\n"
            )
    PAGE.write_text("\n".join(parts), encoding="utf-8")


def told(result: GenerationResult) -> list[str]:
    """Return who reacts to whom, in words."""
    return [str(sentence) for sentence in result.reacting["sentences"]] or ["No vehicle is seen to react to another"]


if __name__ == "__main__":
    main()
