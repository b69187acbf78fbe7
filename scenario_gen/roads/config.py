# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of roads."""

from dataclasses import dataclass, field

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.roads.obstacles import ParkedConfig, read_obstacles


@dataclass(frozen=True)
class RoadConfig(Parameters):
    """Parameters of drawn roads and of the reading of maps; a map has its own geometry."""

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
        "right", "side of the road on which traffic drives", choices=("right", "left")
    )
    traffic_rules: str = parameter(
        "kept",
        "whether scenarios obey stop lines and rights of way, of a vector map or of `priority`",
        choices=("kept", "ignored"),
    )
    priority: str = parameter(
        "auto",
        "signs of a drawn junction; auto: arms whose recorded vehicles yielded give way, as do "
        "those into a roundabout, and recorded lights are drawn; all_way_stop: all stop; "
        "signals: traffic lights",
        choices=("none", "auto", "all_way_stop", "signals"),
    )
    signals: str = parameter(
        "recorded",
        "states of the lights with `priority` signals: recorded ones, which move with the "
        "encounter, or a fixed program of two phases whose offset suits the encounter",
        choices=("recorded", "fixed"),
    )
    crossing: str = parameter(
        "none",
        "crossings on all arms of a junction, or in the middle of a road",
        choices=("none", "zebra"),
    )
    cycle_lane: float = parameter(
        0.0,
        "width of cycle lanes next to the outermost lanes; 0: none",
        unit="m",
        low=0.0,
        high=5.0,
    )
    corridor_margin: float = parameter(
        1.0,
        "room on each side of the recorded footprints in a corridor",
        unit="m",
        low=0.1,
        high=10.0,
    )
    corridor_run_out: float = parameter(
        6.0, "length of a corridor beyond a path's ends", unit="m", low=1.0, high=50.0
    )
    max_cells: int = parameter(
        25_000_000,
        "most cells of a drawn road, or pixels of a map",
        low=1,
        high=100_000_000,
    )
    obstacles: str = parameter(
        "",
        "obstacles, rectangles `x y yaw length width` in the road's frame, separated by `;`",
        unit="m, rad",
    )
    parked: ParkedConfig = field(default_factory=ParkedConfig)
    image_outside_folder: bool = parameter(
        False, "also read a map's image outside the folder of its YAML file"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        read_obstacles(self.obstacles)
        if 0.0 < self.cycle_lane < 1.0:
            raise InputError(f"road.cycle_lane {self.cycle_lane:g} m; choose 0 or at least 1 m")


def refuse_too_many_cells(name: str, width: int, height: int, config: RoadConfig) -> None:
    """Refuse to draw a road that would fill the memory.

    Raises:
        RefusedError: it has more than `max_cells` cells.
    """
    if width * height > config.max_cells:
        raise RefusedError(
            f"road {name} would have {width} x {height} cells, more than road.max_cells "
            f"({config.max_cells}); name a part of a map (#box=x0,y0,x1,y1), "
            "cut the encounter, or set road.resolution or road.max_cells"
        )
