# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""When a trajectory of an OpenSCENARIO file begins: at a time, at a distance, or not known."""

from pathlib import Path

import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log

ENTITY = """<ScenarioObject name="{0}"><Vehicle name="v" vehicleCategory="car"><BoundingBox>
<Center x="0" y="0" z="0"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
</Vehicle></ScenarioObject>"""
TIME = """<ByValueCondition><SimulationTimeCondition value="{}" rule="greaterThan"/>
</ByValueCondition>"""
ENTITY_CONDITION = "<ByEntityCondition><EntityCondition>{}</EntityCondition></ByEntityCondition>"
DISTANCE = ENTITY_CONDITION.format("""<RelativeDistanceCondition entityRef="a" value="25"
relativeDistanceType="euclidianDistance" freespace="false" rule="lessThan"/>""")
COLLISION = ENTITY_CONDITION.format("<CollisionCondition/>")


def trigger(condition: str, delay: float = 0.0) -> str:
    """Return a trigger with one condition."""
    return (
        f'<StartTrigger><ConditionGroup><Condition delay="{delay}">{condition}</Condition>'
        "</ConditionGroup></StartTrigger>"
    )


def group(name: str, start: str, *vertices: tuple[float, float, float]) -> str:
    """Return a vehicle that follows vertices (t, x, y) from a trigger on."""
    line = "".join(
        f'<Vertex time="{t}"><Position><WorldPosition x="{x}" y="{y}"/></Position></Vertex>'
        for t, x, y in vertices
    )
    return f"""<ManeuverGroup><Actors><EntityRef entityRef="{name}"/></Actors><Maneuver><Event>
<Action><PrivateAction><RoutingAction><FollowTrajectoryAction><Trajectory><Shape><Polyline>{line}
</Polyline></Shape></Trajectory><TimeReference><Timing domainAbsoluteRelative="relative" scale="1"
offset="0"/></TimeReference></FollowTrajectoryAction></RoutingAction></PrivateAction></Action>
{start}</Event></Maneuver></ManeuverGroup>"""


def write(folder: Path, start: str, act: str = "") -> Path:
    """Write a file in which b crosses the way of a from a trigger on."""
    times = [k / 2.0 for k in range(21)]
    groups = group("b", start, *((t, 0.0, 3.0 * t - 6.0) for t in times))
    groups += group("a", trigger(TIME.format(0)), *((t, 8.0 * t - 40.0, 0.0) for t in times))
    path = folder / "s.xosc"
    path.write_text(
        f"<OpenSCENARIO><Entities>{ENTITY.format('a')}{ENTITY.format('b')}</Entities><Storyboard>"
        f"<Story><Act>{groups}{act}</Act></Story></Storyboard></OpenSCENARIO>"
    )
    return path


@pytest.mark.parametrize(
    ("start", "act", "begins"),
    [
        (trigger(TIME.format(1.5), delay=0.5), "", 2.0),
        (trigger(TIME.format(1)), trigger(TIME.format(3)), 0.0),
        (trigger(DISTANCE), "", (40.0 - (25.0**2 - 6.0**2) ** 0.5) / 8.0),
    ],
)
def test_a_trajectory_begins_when_its_trigger_says(tmp_path, start, act, begins) -> None:
    (encounter,) = read_log(write(tmp_path, start, act)).encounters
    # the encounter begins with b
    a = encounter.position[encounter.ids.index("a"), 0]
    assert a[0] == pytest.approx(-40.0 + 8.0 * begins, abs=1.0)


def test_another_trigger_is_named(tmp_path) -> None:
    with pytest.raises(
        InputError, match=r"a has a trajectory; b left out: .* its trigger is Coll"
    ):
        read_log(write(tmp_path, trigger(COLLISION)))
