# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How roads are drawn."""

from dataclasses import dataclass

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.roads.obstacles import read_obstacles


@dataclass(frozen=True)
class RoadConfig(Parameters):
    """Parameters of the built-in roads and of `corridor`, and what is read of a map; a map keeps its own geometry."""

    lane_width: float = parameter(3.5, "width of a lane", unit="m", low=2.0, high=1000.0)
    lanes: int = parameter(
        0, "lanes per direction; 0: as many as the recording needs", low=0, high=6
    )
    arm_length: float = parameter(
        0.0, "length of an arm; 0: as long as the recording needs", unit="m", low=0.0, high=2000.0
    )
    corner_radius: float = parameter(
        6.0, "radius of the kerb at a corner", unit="m", low=1.0, high=1000.0
    )
    resolution: float = parameter(0.2, "cell size of the grid", unit="m", low=0.02, high=1.0)
    traffic_side: str = parameter(
        "right", "side of the road that traffic keeps", choices=("right", "left")
    )
    traffic_rules: str = parameter(
        "kept",
        "whether scenarios keep the stop lines and rights of way of a vector map, or of `priority`",
        choices=("kept", "ignored"),
    )
    priority: str = parameter(
        "auto",
        "signs of a drawn junction: auto: arms of those who yielded give way, and into a roundabout; all_way_stop: all stop",
        choices=("none", "auto", "all_way_stop"),
    )
    crossing: str = parameter(
        "none",
        "crossings on all arms of a junction, else in the middle",
        choices=("none", "zebra"),
    )
    cycle_lane: float = parameter(
        0.0,
        "width of cycle lanes beside the outermost lanes; 0: none",
        unit="m",
        low=0.0,
        high=5.0,
    )
    corridor_margin: float = parameter(
        1.0,
        "room on each side of the recording's footprints in a corridor",
        unit="m",
        low=0.1,
        high=10.0,
    )
    corridor_run_out: float = parameter(
        6.0, "how far a corridor goes on beyond a path's ends", unit="m", low=1.0, high=50.0
    )
    paper: bool = parameter(
        False,
        "straight and t_intersection as in the paper: a grid of 1000 x 1000 cells, lengths in cells",
    )
    max_cells: int = parameter(
        25_000_000,
        "most cells of a road that is drawn, or pixels of a map that is read",
        low=1,
        high=100_000_000,
    )
    obstacles: str = parameter(
        "",
        "what stands in the way, rectangles `x y yaw length width` in the road's frame, parted by `;`",
        unit="m, rad",
    )
    image_outside_folder: bool = parameter(
        False, "read also a map's image that lies outside the folder of its YAML file"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        read_obstacles(self.obstacles)
        if 0.0 < self.cycle_lane < 1.0:
            raise InputError(f"road.cycle_lane {self.cycle_lane:g} m; 0 or 1 m and more are drawn")
        if self.paper and (self.cycle_lane or self.crossing != "none"):
            raise InputError(
                "road.paper: the paper's roads have no road.crossing and no road.cycle_lane; unset these"
            )


def refuse_too_many_cells(name: str, width: int, height: int, config: RoadConfig) -> None:
    """Refuse to draw a road that would fill the memory.

    Raises:
        RefusedError: it has more than `max_cells` cells.
    """
    if width * height > config.max_cells:
        raise RefusedError(
            f"road {name} would have {width} x {height} cells, more than road.max_cells ({config.max_cells}); cut the encounter, "
            "or set road.resolution or road.max_cells"
        )
