# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A registry: built-in things first, those of installed packages when they are wanted, and faults of a package by its name."""

import sys

import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.base.registry import installed, Registry

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


def test_plugins_follow_built_in_names(install):
    install("zebra", complex="builtins:complex")
    install("ape", text="builtins:str", binary="builtins:bytes")
    registry = Registry(GROUP, NUMBERS)
    assert registry.names() == ("one", "two", "binary", "complex", "text")
    assert list(registry.values()) == [int, float, bytes, complex, str]
    assert registry["text"] is str and "text" in registry and "none" not in registry


def test_plugin_is_loaded_when_wanted(install):
    folder = install("late", late="late_plugin:make")
    (folder / "late_plugin.py").write_text("def make(): return 1\n")
    registry = Registry(GROUP, NUMBERS)
    assert registry["one"] is int and "late" in registry and registry.names()[-1] == "late"
    assert "late_plugin" not in sys.modules
    assert registry["late"]() == 1
    assert sys.modules.pop("late_plugin")


@pytest.mark.parametrize(
    ("entries", "kind"),
    [
        ({"broken": "no_such_module:f"}, None),
        ({"broken": "builtins:no_such_name"}, None),
        ({"broken": "math:pi"}, None),
        ({"broken": "builtins:len"}, dict),
        ({"broken": "builtins:len", "one": "builtins:len"}, None),
    ],
)
def test_plugin_faults_name_the_distribution(install, entries, kind):
    install("bad", **entries)
    with pytest.raises(InputError, match=r"bad 1\.2"):
        Registry(GROUP, NUMBERS, kind)["broken"]


@pytest.mark.parametrize(
    ("body", "said"),
    [("raise SystemExit(0)", "SystemExit 0"), ("return 1 / 0", "division by zero")],
)
def test_plugin_that_raises_is_named(install, body, said):
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


def test_name_clash_names_both_distributions(install):
    install("left", same="builtins:len")
    install("right", same="builtins:abs")
    with pytest.raises(
        InputError, match=r"left 1\.2 and right 1\.2 both have scenario_gen\.test 'same'"
    ):
        Registry(GROUP, NUMBERS).names()
