# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

import pytest

from scenario_gen.base import xml_reader
from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import parse_xml, read_xml


def test_elements_are_found_with_their_lines():
    root = parse_xml(b"<a>\n<!-- -->\n<b n='2'>x<!-- -->y</b>" + b"\n" * 70_000 + b"<c/></a>", "m")

    assert [child.tag for child in root] == ["b", "c"]
    assert root.child("b").content == "xy"
    assert root.child("b").number("n") == 2.0
    assert root.child("c").place == "m, line 70003, <c>"
    assert root.first_of("z", "c") is root[1]


def test_namespaces_are_removed():
    root = parse_xml(b"<a xmlns='http://u' xmlns:k='http://v'><k:b k:n='1'/></a>", "m")

    assert root.child("b").number("n") == 1.0


@pytest.mark.parametrize("outside", ["file", "http"])
def test_nothing_outside_the_file_is_read(tmp_path, outside):
    secret = tmp_path / "secret.dtd"
    secret.write_text("not a DTD: parsing it would fail, with another message")
    where = secret.as_uri() if outside == "file" else "http://127.0.0.1:9/x.dtd"

    with pytest.raises(InputError, match="line 1: document types"):
        parse_xml(f'<!DOCTYPE a SYSTEM "{where}"><a/>'.encode(), "m")
    with pytest.raises(InputError, match="line 2: document types"):
        parse_xml(f'\n<!DOCTYPE a [<!ENTITY b SYSTEM "{where}">]><a>&b;</a>'.encode(), "m")


def test_an_entity_bomb_is_refused():
    entities = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(9))

    with pytest.raises(InputError, match="not XML"):
        parse_xml(f'<!DOCTYPE x [<!ENTITY a0 "0123456789">{entities}]><x y="&a9;"/>'.encode(), "m")


def test_sizes_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(xml_reader, "MAX_ELEMENT_COUNT", 100)
    monkeypatch.setattr(xml_reader, "MAX_XML_BYTES", 1000)
    path = tmp_path / "map.xml"

    path.write_text("<a>" + "<b/>" * 199 + "</a>")
    with pytest.raises(InputError, match="more than 100 elements"):
        read_xml(path, "m")
    path.write_text("<a>" + " " * 1000 + "</a>")
    with pytest.raises(InputError, match="at most 1000 are read"):
        read_xml(path, "m")


@pytest.mark.parametrize(
    ("attribute", "message"),
    [
        ("n='1e9'", "m, line 1, <a>, attribute n: '1e9' is not a number"),
        ("", "has no attribute n"),
    ],
)
def test_a_bad_number_names_its_place(attribute, message):
    with pytest.raises(InputError, match=message):
        parse_xml(f"<a {attribute}/>".encode(), "m").number("n")
