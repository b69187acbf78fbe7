# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""YAML and JSON with bounds; parameter files and --set: a clear error or a valid value, whatever the text."""

import os

from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from scenario_gen.base.documents import parse_json, read_text, shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import assigned, flatten, read_parameter_file
from scenario_gen.pipeline import PipelineConfig

NAMES = sorted(flatten(PipelineConfig()))
TEXTS = [
    *("'", "...", "!!timestamp x", "<<: *a", "%YAML 9.9", "!!pairs [a]", "\t", "!!bool x", "%s%n"),
    *("a: &a {b: *a}", "!<tag:yaml.org,2002:python/name:os.system> x", "!!float x", '!!int ""'),
    *("0x" + "f" * 5000, "? [a]\n: b", "[" * 5000, "a" * 2_000_000, "\ud800", "--- a\n--- b"),
]


@pytest.mark.parametrize("text", TEXTS, ids=range(len(TEXTS)))
def test_set_says_what_is_wrong(text):
    with pytest.raises(InputError) as error:
        assigned(PipelineConfig(), f"road.lane_width={text}")
    assert "road.lane_width" in str(error.value) and len(str(error.value)) <= 500


@given(
    st.sampled_from(NAMES),
    st.one_of(
        st.text(),
        st.from_regex(r"[-+0-9.eE_:xob\[\]{}&*!'\"]{0,12}"),
        st.floats().map(repr),
        st.integers().map(str),
    ),
)
@settings(max_examples=15)
def test_any_text_is_valid_or_refused(name, text):
    try:
        config = assigned(PipelineConfig(), f"{name}={text}")
    except InputError as error:
        assert name.rpartition(".")[2] in str(error) and len(str(error)) <= 500
    else:
        entry, value = flatten(config)[name]
        assert type(value) is type(entry.default)


@pytest.mark.parametrize("text", ["", "[]", "a: 1", "/**: 3", "/**: {ros__parameters: [1]}"])
def test_file_of_another_form_is_refused(tmp_path, text):
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(InputError, match=r"p\.yaml: not a parameter file"):
        read_parameter_file(tmp_path / "p.yaml")


def test_json_schema_errors_name_the_path():
    schema = {
        "type": "object",
        "properties": {"a": {"type": "array", "items": {"type": "number"}}},
    }
    assert parse_json('{"a": [1, 2]}', "x", schema) == {"a": [1, 2]}
    with pytest.raises(InputError, match=r"x: a\[1\] is None; its schema asks for type number"):
        parse_json('{"a": [1, null]}', "x", schema)


def test_only_regular_files_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "none", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match=str(path)[:40]):
            read_text(path, 100, str(path))


def test_what_is_quoted_is_short():
    deep: list = []
    for _ in range(100_000):
        deep = [deep]
    for value in ("x" * 1000, 10**10_000, deep, ["x" * 1000]):
        assert len(shown(value)) <= 80
