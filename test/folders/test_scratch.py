# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Scratch folders: gone at the end, of the living kept, of the dead swept, wherever a command may have left them."""

from contextlib import suppress
import os

import pytest

from scenario_gen.folders import scratch
from scenario_gen.folders.claim import alone, claim, PREFIX
from scenario_gen.folders.scratch import sweep, sweep_beside


def left(folder):
    return sorted(path for path in folder.rglob(f"{PREFIX}*"))


def killed_in(folder):
    """What a process leaves that is killed: its folder, whose lock the kernel has let go of."""
    folder.mkdir(parents=True, exist_ok=True)
    dead = claim(folder / "scratch")
    (dead.new / "spilled").write_text("much")
    os.close(dead.lock)


@pytest.mark.parametrize("error", [None, KeyError("a fault")])
def test_a_scratch_folder_goes_at_the_end(tmp_path, error):
    with suppress(KeyError), scratch(tmp_path) as place:
        (place / "deep").mkdir()
        (place / "deep" / "file").write_text("x")
        assert place.parent.parent.stat().st_mode & 0o777 == 0o700
        if error:
            raise error
    assert not list(tmp_path.iterdir())


def test_of_the_dead_all_goes_and_of_the_living_nothing(tmp_path):
    with scratch(tmp_path) as place:
        killed_in(tmp_path)
        assert len(left(tmp_path)) == 2
        sweep(tmp_path)
        assert left(tmp_path) == [place.parent.parent]
        killed_in(tmp_path)
        with scratch(tmp_path):
            assert len(left(tmp_path)) == 2, "the next one sweeps before it begins"


def test_who_looks_through_a_folder_is_not_waited_for(tmp_path):
    killed_in(tmp_path)
    with alone(tmp_path):
        sweep(tmp_path)
        assert len(left(tmp_path)) == 1
    sweep(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("words", [["{}"], ["--out", "{}"], ["--out={}"], ["x", "{}/bag"], ["\0", "{}/"]])
def test_a_command_sweeps_where_its_words_point(tmp_path, words):
    places = [tmp_path / "batch", tmp_path / "batch" / "cases", tmp_path / "batch" / "bags" / "road=a"]
    deep = not any("bag" in word for word in words)
    for folder in places if deep else places[:1]:
        killed_in(folder)
    (tmp_path / "batch" / ".scenario_gen-notes").write_text("somebody's own")
    sweep_beside([word.format(tmp_path / "batch") for word in words])
    assert [path.name for path in left(tmp_path)] == [".scenario_gen-notes"]
