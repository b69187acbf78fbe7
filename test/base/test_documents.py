# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""YAML and JSON with bounds; parameter files and --set: a clear error or a valid value, whatever the text."""

import os

from fuzzing.crash_files import crash_files, is_refused
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from scenario_gen.base.documents import parse_json, parse_yaml, read_text, shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import assigned, flatten, loaded, read_parameter_file
from scenario_gen.pipeline import PipelineConfig

NAMES = sorted(flatten(PipelineConfig()))
TEXTS = [
    *(
        "'",
        "...",
        "!!timestamp x",
        "2024-99-99",
        "<<: *a",
        "%YAML 9.9",
        "!!pairs [a]",
        "!!omap [a]",
        "\t",
        "!!bool x",
        "*a",
        "%s%n",
    ),
    *(
        "a: &a {b: *a}",
        "{a: [}",
        "!<tag:yaml.org,2002:python/name:os.system> x",
        "\x1b",
        "!!float x",
        "!!map [a]",
        "!!set {a}",
    ),
    *("!!binary a", '!!int ""'),
]
TEXTS += [
    "9" * 5000,
    "0x" + "f" * 5000,
    "? [a]\n: b",
    "[" * 5000,
    "a" * 2_000_000,
    "\ud800",
    "--- a\n--- b",
]


@pytest.mark.parametrize(
    "file", crash_files("params/*", "params_*", "deep.yaml", "map_alias*"), indirect=True
)
def test_a_broken_parameter_file_is_named(file):
    is_refused(lambda: loaded(PipelineConfig(), file), str(file))


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
def test_any_text_is_a_valid_value_or_a_clear_error(name, text):
    try:
        config = assigned(PipelineConfig(), f"{name}={text}")
    except InputError as error:
        assert name.rpartition(".")[2] in str(error) and len(str(error)) <= 500
    else:
        entry, value = flatten(config)[name]
        assert type(value) is type(entry.default)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "a: 1\nb: 2\n",
        "/**: 3",
        "/**: {ros__parameters: 3}",
        "/**: {ros__parameters: [1]}",
        "3",
        "null",
    ],
)
def test_a_file_of_another_form_is_refused(tmp_path, text):
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(InputError, match=r"p\.yaml: not a parameter file"):
        read_parameter_file(tmp_path / "p.yaml")


def test_plain_values_are_read_as_they_are_written():
    assert parse_yaml("a: [1, 2.5, true, null, x, '1']\n<<: 3\n2024-01-01: 1_000\n", "x") == {
        "a": [1, 2.5, True, None, "x", "1"],
        "<<": 3,
        "2024-01-01": 1000,
    }


def test_json_keeps_its_schema_and_the_path_is_named():
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
