# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small vector maps, written to the formats' definitions: one crossroads of a lane each way, in all three formats."""

from html import escape
import math

HALF, ARM, WIDTH = 8.0, 60.0, 3.5  # metres: half the junction, the arms' ends, a lane
ARMS = {
    "w": (1, 0),
    "e": (-1, 0),
    "s": (0, 1),
    "n": (0, -1),
}  # by which traffic comes in, and where it then heads
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
                    [
                        at(arm, -HALF + r * math.sin(a), side * (HALF - r * math.cos(a)))
                        for a in turn
                    ]
                    for r in (HALF, HALF - side * WIDTH)
                ]
            found[f"{arm}_{way}"] = (*borders, [f"{lead[arm]}_out"])
    return found


def commonroad(offset=(0.0, 0.0), extra="", signs=None):
    """Return the crossroads as CommonRoad 2020a; `signs` are numbers of signs by arm ("205"), "light" is a light."""
    found = lanes()
    number = {name: str(100 + k) for k, name in enumerate(found)}
    before = {name: [other for other in found if name in found[other][2]] for name in found}

    def bound(tag, points):
        return (
            f"<{tag}>"
            + "".join(
                f"<point><x>{x + offset[0]!r}</x><y>{y + offset[1]!r}</y></point>"
                for x, y in points
            )
            + f"</{tag}>"
        )

    def signed(name):
        kind = (signs or {}).get(name.removesuffix("_in"))
        tag = "trafficLightRef" if kind == "light" else "trafficSignRef"
        return (
            f'<{tag} ref="{50 + list(ARMS).index(name[0])}"/>'
            if kind and name.endswith("_in")
            else ""
        )

    text = "".join(
        f'<lanelet id="{number[name]}">{bound("leftBound", left)}{bound("rightBound", right)}'
        + "".join(f'<predecessor ref="{number[other]}"/>' for other in before[name])
        + "".join(f'<successor ref="{number[other]}"/>' for other in after)
        + f'<laneletType>urban</laneletType><trafficSignRef ref="7"/>{signed(name)}</lanelet>'
        for name, (left, right, after) in found.items()
    )
    sign = "<trafficSign id='7'><trafficSignElement><trafficSignID>274</trafficSignID>"
    sign += (
        f"<additionalValue>{LIMIT / 3.6!r}</additionalValue></trafficSignElement></trafficSign>"
    )
    for arm, kind in (signs or {}).items():
        number_of = f"id='{50 + list(ARMS).index(arm)}'"
        if kind == "light":
            sign += f"<trafficLight {number_of}/>"
        else:
            sign += f"<trafficSign {number_of}><trafficSignElement><trafficSignID>{kind}</trafficSignID></trafficSignElement>"
            sign += "</trafficSign>"
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


def lanelet2(
    place=lambda x, y: (
        f'lat="0.0" lon="0.0"><tag k="local_x" v="{x!r}"/><tag k="local_y" v="{y!r}"/>'
    ),
    tags="",
    signs=None,
):
    """Return the crossroads as Lanelet2; `place` writes a node's coordinates; every second border is written backwards.

    `signs` as of `commonroad`; their stop lines are ways across the ends of lanes.
    """
    nodes, ways, relations = {}, [], []

    def node(point):
        key = (round(point[0], 6), round(point[1], 6))
        return nodes.setdefault(key, (len(nodes) + 1, point))[0]

    def way(points, backwards):
        refs = [node(point) for point in points][:: -1 if backwards else 1]
        ways.append(
            f'<way id="{1000 + len(ways)}">'
            + "".join(f'<nd ref="{ref}"/>' for ref in refs)
            + "</way>"
        )
        return 999 + len(ways)

    elements = []
    for k, (name, (left, right, _)) in enumerate(lanes().items()):
        members = [("left", way(left, k % 2)), ("right", way(right, k % 3 == 0))]
        kind = (signs or {}).get(name.removesuffix("_in"))
        element = ""
        if kind and name.endswith("_in"):
            element = f'<member type="relation" ref="{3000 + k}" role="regulatory_element"/>'
            line = way([left[-1], right[-1]], False)
            sign = way([right[-1], right[-2]], False)
            ways[-1] = ways[-1].replace(
                "</way>", f'<tag k="type" v="traffic_sign"/><tag k="subtype" v="de{kind}"/></way>'
            )
            elements.append(
                f'<relation id="{3000 + k}"><member type="way" ref="{line}" role="ref_line"/>'
                f'<member type="way" ref="{sign}" role="refers"/><tag k="type" v="regulatory_element"/>'
                f'<tag k="subtype" v="{"traffic_light" if kind == "light" else "traffic_sign"}"/></relation>'
            )
        relations.append(
            f'<relation id="{2000 + k}">'
            + "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for role, ref in members)
            + element
            + f'<tag k="type" v="lanelet"/><tag k="subtype" v="road"/><tag k="location" v="urban"/><tag k="one_way" v="yes"/>'
            f'<tag k="speed_limit" v="{LIMIT:g}"/>{tags}</relation>'
        )
    text = "".join(
        f'<node id="{number}" {place(*point)}</node>' for number, point in nodes.values()
    )
    return f'<?xml version="1.0"?><osm version="0.6">{text}{"".join(ways)}{"".join(relations + elements)}</osm>'


def opendrive(reference="", signs=None):
    """Return the crossroads as OpenDRIVE 1.6: an arm has the lanes -1 (in) and 1 (out), a turn -1; `signs` as of `commonroad`."""
    lane = '<lane id="{}" type="driving" level="false"><link>{}</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    roads, connections = [], []

    def signal(arm, length):
        kind = (signs or {}).get(arm)
        if not kind:
            return ""
        what = 'type="1000001" dynamic="yes"' if kind == "light" else f'type="{kind}" dynamic="no"'
        return f'<signals><signal s="{length - 1.0!r}" t="-4" id="{arm}" orientation="+" country="DE" {what}/></signals>'

    def road(number, junction, link, start, heading, length, shape, left, right, extra=""):
        sides = "".join(
            f"<{tag}>{text}</{tag}>"
            for tag, text in (
                ("left", left),
                ("center", '<lane id="0" type="none"/>'),
                ("right", right),
            )
            if text
        )
        roads.append(
            f'<road name="" length="{length!r}" id="{number}" junction="{junction}"><link>{link}</link>'
            f'<type s="0" type="town"><speed max="{LIMIT:g}" unit="km/h"/></type><planView><geometry s="0" x="{start[0]!r}" '
            f'y="{start[1]!r}" hdg="{heading!r}" length="{length!r}">{shape}</geometry></planView>'
            f'<lanes><laneSection s="0">{sides}</laneSection></lanes>{extra}</road>'
        )

    for k, (arm, (dx, dy)) in enumerate(ARMS.items()):
        heading = math.atan2(dy, dx)
        to = '<successor elementType="junction" elementId="5"/>'
        sides = lane.format(1, ""), lane.format(-1, "")
        road(
            k,
            -1,
            to,
            at(arm, -ARM, 0.0),
            heading,
            ARM - HALF,
            "<line/>",
            *sides,
            signal(arm, ARM - HALF),
        )
        for j, (way, lead) in enumerate(LEADS.items()):
            number, out = 10 + 3 * k + j, list(ARMS).index(lead[arm])
            link = "".join(
                f'<{tag} elementType="road" elementId="{other}" contactPoint="end"/>'
                for tag, other in (("predecessor", k), ("successor", out))
            )
            shape, length = ("<line/>", 2.0 * HALF)
            if way != "straight":
                shape = f'<arc curvature="{(1.0 if way == "left" else -1.0) / HALF!r}"/>'
                length = math.pi * HALF / 2.0
            links = '<predecessor id="-1"/><successor id="1"/>'
            road(
                number,
                5,
                link,
                at(arm, -HALF, 0.0),
                heading,
                length,
                shape,
                "",
                lane.format(-1, links),
            )
            connections.append(
                f'<connection id="{number}" incomingRoad="{k}" connectingRoad="{number}" contactPoint="start">'
                '<laneLink from="-1" to="-1"/>'
                "</connection>"
            )
    header = f'<header revMajor="1" revMinor="6">{f"<geoReference>{escape(reference)}</geoReference>" if reference else ""}</header>'
    junction = f'<junction name="" id="5">{"".join(connections)}</junction>'
    return f'<?xml version="1.0"?><OpenDRIVE>{header}{"".join(roads)}{junction}</OpenDRIVE>'


FORMATS = {".xml": commonroad, ".osm": lanelet2, ".xodr": opendrive}


def write(folder, suffix, text=None):
    """Write a map and return its path."""
    path = folder / f"crossroads{suffix}"
    path.write_text(FORMATS[suffix]() if text is None else text)
    return path
