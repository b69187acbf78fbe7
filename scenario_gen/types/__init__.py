# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What passes from stage to stage: frozen, no stage imported."""

from scenario_gen.base.road_users import (
    CAR,
    Dynamics,
    LANE_USERS,
    MAX_PLANNED_CURVATURE_PER_M,
    OTHER,
    TypeLimits,
    usual_type,
    VEHICLE_TYPES,
    VehicleType,
    words,
)
from scenario_gen.types.body import height, rear_axle, shifted, WHEELBASE
from scenario_gen.types.coverage import Coverage, Spread
from scenario_gen.types.ego import join_ego, split_off, with_witness
from scenario_gen.types.encounter import Encounter, Recombined, Recorded
from scenario_gen.types.evaluation import (
    as_markdown,
    CheckCounts,
    Evaluation,
    formatted,
    Interval,
    Metric,
    Row,
    SCHEMA,
)
from scenario_gen.types.facts import (
    Facts,
    Failure,
    FOLLOW,
    NamedReaction,
    OrderChange,
    PassingOrder,
    YIELD,
)
from scenario_gen.types.fit import Fit, FittedVehicle, Loss
from scenario_gen.types.generation import ERRORS, GenerationResult
from scenario_gen.types.lanes import (
    CARS,
    DrawnFor,
    DRIVERS,
    Lane,
    LaneNetwork,
    LEVEL,
    RuleKind,
    TrafficRule,
)
from scenario_gen.types.measures import Measure, Measures
from scenario_gen.types.motion import Motion, States
from scenario_gen.types.names import token, tokens, vehicle_index
from scenario_gen.types.notes import Note, note_kinds, NoteKind, recorded_notes
from scenario_gen.types.pieces import join_pieces, read_numbers, split_pieces
from scenario_gen.types.presence import (
    ALWAYS,
    always,
    at_ends,
    canonical_presence,
    cut,
    mask,
    together,
)
from scenario_gen.types.qos import Quality
from scenario_gen.types.reaction import (
    Reaction,
    ReactionGraph,
)
from scenario_gen.types.request import ENDS, ORDERS, read_states, Request, State
from scenario_gen.types.road import COARSEST, FARTHEST, FINEST, Road
from scenario_gen.types.route import Route, routes_in_words
from scenario_gen.types.row_names import (
    NARROW,
    RECORDING,
    REPLAY,
    UNIFORM,
    WITH,
    WITHOUT,
)
from scenario_gen.types.sample import Sample
from scenario_gen.types.scenario import (
    BoundaryStates,
    Cause,
    causes_in_words,
    EgoSlot,
    Scenario,
    ScenarioSet,
    Verdict,
    Violation,
)
from scenario_gen.types.segmentation import LiveChangepoints, Segmentation
from scenario_gen.types.target import Pair, Reached, Target, UNITS
from scenario_gen.types.vehicle import most_exposed, Vehicle

__all__ = [
    "ALWAYS",
    "CAR",
    "CARS",
    "COARSEST",
    "DRIVERS",
    "ENDS",
    "ERRORS",
    "FARTHEST",
    "FINEST",
    "FOLLOW",
    "LANE_USERS",
    "LEVEL",
    "MAX_PLANNED_CURVATURE_PER_M",
    "NARROW",
    "ORDERS",
    "OTHER",
    "RECORDING",
    "REPLAY",
    "SCHEMA",
    "UNIFORM",
    "UNITS",
    "VEHICLE_TYPES",
    "WHEELBASE",
    "WITH",
    "WITHOUT",
    "YIELD",
    "BoundaryStates",
    "Cause",
    "CheckCounts",
    "Coverage",
    "DrawnFor",
    "Dynamics",
    "EgoSlot",
    "Encounter",
    "Evaluation",
    "Facts",
    "Failure",
    "Fit",
    "FittedVehicle",
    "GenerationResult",
    "Interval",
    "Lane",
    "LaneNetwork",
    "LiveChangepoints",
    "Loss",
    "Measure",
    "Measures",
    "Metric",
    "Motion",
    "NamedReaction",
    "Note",
    "NoteKind",
    "OrderChange",
    "Pair",
    "PassingOrder",
    "Quality",
    "Reached",
    "Reaction",
    "ReactionGraph",
    "Recombined",
    "Recorded",
    "Request",
    "Road",
    "Route",
    "Row",
    "RuleKind",
    "Sample",
    "Scenario",
    "ScenarioSet",
    "Segmentation",
    "Spread",
    "State",
    "States",
    "Target",
    "TrafficRule",
    "TypeLimits",
    "Vehicle",
    "VehicleType",
    "Verdict",
    "Violation",
    "always",
    "as_markdown",
    "at_ends",
    "canonical_presence",
    "causes_in_words",
    "cut",
    "formatted",
    "height",
    "join_ego",
    "join_pieces",
    "mask",
    "most_exposed",
    "note_kinds",
    "read_numbers",
    "read_states",
    "rear_axle",
    "recorded_notes",
    "routes_in_words",
    "shifted",
    "split_off",
    "split_pieces",
    "together",
    "token",
    "tokens",
    "usual_type",
    "vehicle_index",
    "with_witness",
    "words",
]  # fmt: skip
