# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A registry: built-in things first, those of installed packages when they are wanted, and faults of a package by its name."""

from importlib.machinery import PathFinder
from pathlib import Path
import sys

import pytest

import scenario_gen
from scenario_gen.base.errors import InputError
from scenario_gen.base.registry import installed, load_class, Registry

GROUP = "scenario_gen.test"
NUMBERS = {"one": int, "two": float}


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a distribution with these entry points; modules of plugins are in the same folder."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(name, **entries):
        folder = tmp_path / f"{name}-1.2.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (folder / "entry_points.txt").write_text(
            "\n".join([f"[{GROUP}]", *(f"{k} = {v}" for k, v in entries.items())])
        )
        installed.cache_clear()
        return tmp_path

    yield install
    installed.cache_clear()


def test_plugins_come_after_what_is_built_in_and_in_the_order_of_their_names(install):
    install("zebra", complex="builtins:complex")
    install("ape", text="builtins:str", binary="builtins:bytes")
    registry = Registry(GROUP, NUMBERS)
    assert registry.names() == ("one", "two", "binary", "complex", "text")
    assert list(registry.values()) == [int, float, bytes, complex, str]
    assert registry["text"] is str and "text" in registry and "none" not in registry


def test_a_plugin_is_loaded_when_it_is_wanted_and_not_before(install):
    folder = install("late", late="late_plugin:make")
    (folder / "late_plugin.py").write_text("def make(): return 1\n")
    registry = Registry(GROUP, NUMBERS)
    assert registry["one"] is int and "late" in registry and registry.names()[-1] == "late"
    assert "late_plugin" not in sys.modules
    assert registry["late"]() == 1
    assert sys.modules.pop("late_plugin")


def test_what_is_built_in_needs_no_look_at_packages(monkeypatch):
    monkeypatch.setattr("scenario_gen.base.registry.entry_points", None)
    installed.cache_clear()
    assert Registry(GROUP, NUMBERS)["two"] is float and "two" in Registry(GROUP, NUMBERS)


@pytest.mark.parametrize(
    ("entries", "kind", "message"),
    [
        (
            {"broken": "no_such_module:f"},
            None,
            r"plugin 'broken' of bad 1\.2 cannot be loaded: No module named 'no_such_module'",
        ),
        (
            {"broken": "builtins:no_such_name"},
            None,
            r"plugin 'broken' of bad 1\.2 cannot be loaded: .*no_such_name",
        ),
        ({"broken": "math:pi"}, None, r"plugin 'broken' of bad 1\.2 is no function: math:pi"),
        (
            {"broken": "builtins:len"},
            dict,
            r"plugin 'broken' of bad 1\.2 is no dict: builtins:len",
        ),
        (
            {"one": "builtins:len"},
            None,
            r"bad 1\.2 has scenario_gen\.test 'one', which is built in",
        ),
        ({}, None, r"'broken' is none of the test one, two$"),
    ],
)
def test_what_is_wrong_with_a_plugin_names_its_distribution(install, entries, kind, message):
    install("bad", **entries)
    with pytest.raises(InputError, match=message):
        Registry(GROUP, NUMBERS, kind)["broken"]


@pytest.mark.parametrize(
    ("body", "said"),
    [("raise SystemExit(0)", "SystemExit 0"), ("return 1 / 0", "division by zero")],
)
def test_a_plugin_that_raises_or_exits_is_named(install, body, said):
    (install("bad", own="bad_plugin:make") / "bad_plugin.py").write_text(
        f"def make():\n    {body}\n"
    )
    registry = Registry(GROUP, NUMBERS)
    make = registry["own"]
    del sys.modules["bad_plugin"]
    with (
        pytest.raises(InputError, match=rf"plugin 'own' of bad 1\.2 failed: {said}"),
        registry.running("own"),
    ):
        make()
    with pytest.raises(InputError, match="ours"), registry.running("own"):
        raise InputError("ours")
    with (
        pytest.raises(ZeroDivisionError),
        registry.running("one"),
    ):  # a fault of our own is not hidden
        1 / 0  # noqa: B018


def test_two_distributions_with_one_name_are_both_named(install):
    install("left", same="builtins:len")
    install("right", same="builtins:abs")
    with pytest.raises(
        InputError, match=r"left 1\.2 and right 1\.2 both have scenario_gen\.test 'same'"
    ):
        Registry(GROUP, NUMBERS).names()


def test_a_folder_with_this_package_s_name_does_not_hide_it_from_other_processes(
    tmp_path, monkeypatch
):
    (tmp_path / "scenario_gen").mkdir()
    (tmp_path / "module_in_the_folder.py").write_text("class Planner: ...\n")
    monkeypatch.chdir(tmp_path)
    installed = Path(scenario_gen.__file__).parents[1]
    elsewhere = [path for path in sys.path if Path(path or ".").resolve() != installed]
    monkeypatch.setattr(sys, "path", elsewhere)
    load_class("--planner", "module_in_the_folder:Planner")
    spec = PathFinder.find_spec("scenario_gen", sys.path)
    assert spec is not None and spec.origin == scenario_gen.__file__
