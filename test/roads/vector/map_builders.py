# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small vector maps, written to the formats' definitions: one crossroads of a lane each way, in all three formats."""

from html import escape
import math

HALF, ARM, WIDTH = 8.0, 60.0, 3.5  # metres: half the junction, the arms' ends, a lane
ARMS = {"w": (1, 0), "e": (-1, 0), "s": (0, 1), "n": (0, -1)}  # by which traffic comes in, and where it then heads
LEADS = {  # where one comes out
    "straight": {"w": "e", "e": "w", "s": "n", "n": "s"},
    "right": {"w": "s", "s": "e", "e": "n", "n": "w"},
    "left": {"w": "n", "n": "e", "e": "s", "s": "w"},
}
LIMIT = 30.0  # km/h


def at(arm, along, aside):
    """Return a point by how far it lies ahead of the middle and to the right, seen by who comes in by an arm."""
    dx, dy = ARMS[arm]
    return (along * dx + aside * dy, along * dy - aside * dx)


def lanes():
    """Return {id: (left border, right border, successors)}."""
    found = {}
    for arm in ARMS:
        ends = (-ARM, -HALF)
        into, out = ([at(arm, x, aside) for x in ends] for aside in (WIDTH, -WIDTH))
        middle = [at(arm, x, 0.0) for x in ends]
        found[f"{arm}_in"] = (middle, into, [f"{arm}_{way}" for way in LEADS])
        found[f"{arm}_out"] = (middle[::-1], out[::-1], [])
        for way, lead in LEADS.items():
            if way == "straight":
                borders = [[at(arm, x, aside) for x in (-HALF, HALF)] for aside in (0.0, WIDTH)]
            else:
                side = 1.0 if way == "right" else -1.0
                turn = [k * math.pi / 20.0 for k in range(11)]
                borders = [
                    [at(arm, -HALF + r * math.sin(a), side * (HALF - r * math.cos(a))) for a in turn]
                    for r in (HALF, HALF - side * WIDTH)
                ]
            found[f"{arm}_{way}"] = (*borders, [f"{lead[arm]}_out"])
    return found


def commonroad(offset=(0.0, 0.0), extra=""):
    """Return the crossroads as CommonRoad 2020a."""
    found = lanes()
    number = {name: str(100 + k) for k, name in enumerate(found)}
    before = {name: [other for other in found if name in found[other][2]] for name in found}

    def bound(tag, points):
        return (
            f"<{tag}>"
            + "".join(f"<point><x>{x + offset[0]!r}</x><y>{y + offset[1]!r}</y></point>" for x, y in points)
            + f"</{tag}>"
        )

    text = "".join(
        f'<lanelet id="{number[name]}">{bound("leftBound", left)}{bound("rightBound", right)}'
        + "".join(f'<predecessor ref="{number[other]}"/>' for other in before[name])
        + "".join(f'<successor ref="{number[other]}"/>' for other in after)
        + '<laneletType>urban</laneletType><trafficSignRef ref="7"/></lanelet>'
        for name, (left, right, after) in found.items()
    )
    sign = "<trafficSign id='7'><trafficSignElement><trafficSignID>274</trafficSignID>"
    sign += f"<additionalValue>{LIMIT / 3.6!r}</additionalValue></trafficSignElement></trafficSign>"
    crossing = "<intersection id='9'>" + "".join(
        f"<incoming id='{900 + k}'><incomingLanelet ref='{number[f'{arm}_in']}'/>"
        f"<successorsRight ref='{number[f'{arm}_right']}'/>"
        f"<successorsStraight ref='{number[f'{arm}_straight']}'/><successorsLeft ref='{number[f'{arm}_left']}'/></incoming>"
        for k, arm in enumerate(ARMS)
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><commonRoad timeStepSize="0.1" commonRoadVersion="2020a">{text}'
        f"{sign}{crossing}</intersection>{extra}</commonRoad>"
    )


def lanelet2(place=lambda x, y: f'lat="0.0" lon="0.0"><tag k="local_x" v="{x!r}"/><tag k="local_y" v="{y!r}"/>', tags=""):
    """Return the crossroads as Lanelet2; `place` writes a node's coordinates; every second border is written backwards."""
    nodes, ways, relations = {}, [], []

    def node(point):
        key = (round(point[0], 6), round(point[1], 6))
        return nodes.setdefault(key, (len(nodes) + 1, point))[0]

    def way(points, backwards):
        refs = [node(point) for point in points][:: -1 if backwards else 1]
        ways.append(f'<way id="{1000 + len(ways)}">' + "".join(f'<nd ref="{ref}"/>' for ref in refs) + "</way>")
        return 999 + len(ways)

    for k, (left, right, _) in enumerate(lanes().values()):
        members = (("left", way(left, k % 2)), ("right", way(right, k % 3 == 0)))
        relations.append(
            f'<relation id="{2000 + k}">'
            + "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for role, ref in members)
            + f'<tag k="type" v="lanelet"/><tag k="subtype" v="road"/><tag k="location" v="urban"/><tag k="one_way" v="yes"/>'
            f'<tag k="speed_limit" v="{LIMIT:g}"/>{tags}</relation>'
        )
    text = "".join(f'<node id="{number}" {place(*point)}</node>' for number, point in nodes.values())
    return f'<?xml version="1.0"?><osm version="0.6">{text}{"".join(ways)}{"".join(relations)}</osm>'


def opendrive(reference=""):
    """Return the crossroads as OpenDRIVE 1.6: an arm has the lanes -1 (in) and 1 (out), a turn -1."""
    lane = '<lane id="{}" type="driving" level="false"><link>{}</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    roads, connections = [], []

    def road(number, junction, link, start, heading, length, shape, left, right):
        sides = "".join(
            f"<{tag}>{text}</{tag}>"
            for tag, text in (("left", left), ("center", '<lane id="0" type="none"/>'), ("right", right))
            if text
        )
        roads.append(
            f'<road name="" length="{length!r}" id="{number}" junction="{junction}"><link>{link}</link>'
            f'<type s="0" type="town"><speed max="{LIMIT:g}" unit="km/h"/></type><planView><geometry s="0" x="{start[0]!r}" '
            f'y="{start[1]!r}" hdg="{heading!r}" length="{length!r}">{shape}</geometry></planView>'
            f'<lanes><laneSection s="0">{sides}</laneSection></lanes></road>'
        )

    for k, (arm, (dx, dy)) in enumerate(ARMS.items()):
        heading = math.atan2(dy, dx)
        to = '<successor elementType="junction" elementId="5"/>'
        road(k, -1, to, at(arm, -ARM, 0.0), heading, ARM - HALF, "<line/>", lane.format(1, ""), lane.format(-1, ""))
        for j, (way, lead) in enumerate(LEADS.items()):
            number, out = 10 + 3 * k + j, list(ARMS).index(lead[arm])
            link = "".join(
                f'<{tag} elementType="road" elementId="{other}" contactPoint="end"/>'
                for tag, other in (("predecessor", k), ("successor", out))
            )
            shape, length = ("<line/>", 2.0 * HALF)
            if way != "straight":
                shape, length = f'<arc curvature="{(1.0 if way == "left" else -1.0) / HALF!r}"/>', math.pi * HALF / 2.0
            links = '<predecessor id="-1"/><successor id="1"/>'
            road(number, 5, link, at(arm, -HALF, 0.0), heading, length, shape, "", lane.format(-1, links))
            connections.append(
                f'<connection id="{number}" incomingRoad="{k}" connectingRoad="{number}" contactPoint="start">'
                '<laneLink from="-1" to="-1"/>'
                "</connection>"
            )
    header = (
        f'<header revMajor="1" revMinor="6">{f"<geoReference>{escape(reference)}</geoReference>" if reference else ""}</header>'
    )
    junction = f'<junction name="" id="5">{"".join(connections)}</junction>'
    return f'<?xml version="1.0"?><OpenDRIVE>{header}{"".join(roads)}{junction}</OpenDRIVE>'


FORMATS = {".xml": commonroad, ".osm": lanelet2, ".xodr": opendrive}


def write(folder, suffix, text=None):
    """Write a map and return its path."""
    path = folder / f"crossroads{suffix}"
    path.write_text(FORMATS[suffix]() if text is None else text)
    return path
