# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""First mistakes in calls of the library: what has one meaning works, the rest is refused in one line."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.source_files import ROOT

import scenario_gen as sg

LOG = ROOT / "examples" / "my_log.csv"


@pytest.fixture(scope="module")
def encounter():
    """The encounter of the example's log."""
    return sg.read_log(LOG).encounters[0]


@pytest.fixture(scope="module")
def expected(encounter):
    """One scenario with default arguments."""
    return sg.generate(encounter, "four_way", count=1)


def test_log_path_and_table_are_equal(expected):
    for source in (sg.read_log(LOG), str(LOG), pd.read_csv(LOG)):
        made = sg.generate(source, "four_way", count=1)
        assert np.array_equal(made, expected)


def test_equal_calls_are_equal(encounter, expected):
    made = sg.generate(encounter, "four_way", {"sampling": {"lateral_sigma": 0.2}}, count=1)
    assert expected == sg.generate(encounter, "four_way", count=1) != made
    array = np.asarray(expected[0])
    assert array.shape == (2, len(expected[0].time), 4)
    assert np.array_equal(array[..., 3], expected[0].speed)


def test_drawn_seed_and_progress_are_shown(encounter, capsys):
    made = sg.generate(encounter, "four_way", count=1, seed=None, progress=True)
    assert np.array_equal(made, sg.generate(encounter, "four_way", count=1, seed=made.seed))
    assert "1 of 1 scenarios" in capsys.readouterr().err


def test_text_or_mapping_is_a_request():
    for request in ("pet=1..2", {"target": "pet=1..2"}):
        made = sg.generate(LOG, Path("four_way"), count=1, request=request)
        assert made.measures().pet.between(1.0, 2.0).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda e: sg.generate(e, "four_way", count="5"), "count: a whole number"),
        (lambda e: sg.generate(e, "four_way", seed=-1), "seed: a whole number of at least 0"),
        (lambda e: sg.generate(e, "four_way", progress=3), "progress: True or a function"),
        (lambda e: sg.generate(e, "four_way", sg.SamplingConfig()), "config: a PipelineConfig"),
        (lambda e: sg.generate(e, "four_way", {"sampling": {"x": 1}}), "unknown parameter"),
        (lambda e: sg.generate(e, "four_way", request=3), "request: a Request"),
        (lambda _: sg.generate(3, "four_way"), "encounter: an encounter, a list"),
        (lambda _: sg.generate([], "four_way"), "encounter: an encounter, a list"),
        (lambda _: sg.read_log(None), "read_log: a path"),
        (lambda e: sg.generate_many([e]), "generate_many: pairs"),
        (lambda e: sg.trials_of(e, ego="2"), "trials_of: a result"),
    ],
)
def test_other_arguments_are_refused(encounter, call, message):
    with pytest.raises(sg.InputError, match=message) as refused:
        call(encounter)
    assert "\n" not in str(refused.value)


def test_log_with_several_encounters_is_refused(encounter):
    log = sg.LogResult((encounter, encounter), None)
    with pytest.raises(sg.InputError, match="has 2 encounters: give one of them"):
        sg.generate(log, "four_way")
