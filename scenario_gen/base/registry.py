# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Registries of roads, planners, log and export formats, metrics and criteria.

Built-in ones and those of installed packages.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import entry_points, EntryPoint
from importlib.util import find_spec
from pathlib import Path
import pkgutil
import sys
from typing import Any, cast, Generic, TypeVar

from scenario_gen.base.errors import describe, did_you_mean, InputError, ScenarioGenError

T = TypeVar("T")


@cache
def installed(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of a group by name, sorted and not loaded.

    Raises:
        InputError: two distributions use one name.
    """
    plugins: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: (entry.name, _source(entry))):
        if entry.name in plugins:
            sources = f"{_source(plugins[entry.name])} and {_source(entry)}"
            raise InputError(f"plugins: {sources} both have {group} {entry.name!r}")
        plugins[entry.name] = entry
    return plugins


def load_class(option: str, name: str) -> Any:
    """Return the class that a user names as MODULE:CLASS.

    The current folder is searched last, and only for a module that is not installed.

    Args:
        option: the option or parameter, for messages.
        name: MODULE:CLASS.

    Raises:
        InputError: there is no such module or class.
    """
    module, colon, attribute = name.partition(":")
    if not (colon and module and attribute):
        raise InputError(f"{option} {name}: write it as MODULE:CLASS, e.g. my_module:MyClass")
    try:
        if find_spec(module.partition(".")[0]) is None and str(Path.cwd()) not in sys.path:
            # This package comes first, lest a folder of its name hides it from other processes.
            sys.path += [str(Path(__file__).parents[2]), str(Path.cwd())]
        loaded = pkgutil.resolve_name(name)
    except ImportError as error:
        raise InputError(
            f"{option} {name}: {error}; run in the folder of the module, or put it on PYTHONPATH"
        ) from error
    except AttributeError as error:
        classes = [member for member in vars(sys.modules[module]) if member[:1].isupper()]
        near = did_you_mean(attribute, classes)
        raise InputError(f"{option} {name}: {error}; name a class of that module{near}") from error
    except (Exception, SystemExit) as error:  # the module runs
        raise InputError(f"{option} {name}: {describe(error)}") from error
    if not callable(loaded):
        raise InputError(f"{option} {name}: not a class")
    return loaded


def _source(entry: EntryPoint) -> str:
    """Return the distribution of an entry point with its version."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


class Registry(Generic[T]):
    """Objects of one kind by name: built-in ones, and entry points of installed packages.

    Source: Python Packaging User Guide, "Creating and discovering plugins".
    """

    def __init__(self, group: str, built_in: Mapping[str, T], kind: type | None = None) -> None:
        """Create a registry.

        Installed packages are searched only for lists and for names that are not built in.

        Args:
            group: of the entry points, e.g. "scenario_gen.roads".
            built_in: objects by name, in the order in which they are listed and tried.
            kind: the required class of an entry point's object; None: it must be callable.
        """
        self.group = group
        self.kind = kind
        self.built_in = built_in

    def names(self) -> tuple[str, ...]:
        """Return all names: the built-in ones, then the others, sorted.

        Raises:
            InputError: two distributions use one name, or one uses a built-in name.
        """
        plugins = installed(self.group)
        for name in sorted(plugins.keys() & self.built_in.keys()):
            raise InputError(
                f"plugins: {_source(plugins[name])} has {self.group} {name!r}, which is built in; "
                "it must be renamed"
            )
        return (*self.built_in, *plugins)

    def __contains__(self, name: str) -> bool:
        """Return whether an object has this name."""
        return name in self.built_in or name in self.names()

    def __getitem__(self, name: str) -> T:
        """Return the object with a name.

        Raises:
            InputError: there is none, its plugin cannot be loaded or has a wrong kind, or `names`
                fails.
        """
        if name in self.built_in:
            return self.built_in[name]
        if name not in self:
            kind = self.group.partition(".")[2].replace("_", " ")
            raise InputError(
                f"{name!r} is none of the {kind} {', '.join(self.names())}"
                f"{did_you_mean(name, self.names())}"
            )
        entry = installed(self.group)[name]
        try:
            loaded = entry.load()
        except (Exception, SystemExit) as error:
            raise InputError(
                f"plugin {name!r} of {_source(entry)} cannot be loaded: {describe(error)}"
            ) from error
        if not (callable(loaded) if self.kind is None else isinstance(loaded, self.kind)):
            kind = "function" if self.kind is None else self.kind.__name__
            raise InputError(f"plugin {name!r} of {_source(entry)} is no {kind}: {entry.value}")
        return cast(T, loaded)

    @contextmanager
    def running(self, name: str) -> Iterator[None]:
        """Convert an error in a plugin's code into one that names the plugin.

        Raises:
            InputError: the plugin raised an error that is not ours, or tried to exit.
        """
        try:
            yield
        except ScenarioGenError:
            raise
        except (Exception, SystemExit) as error:
            if name in self.built_in:
                raise
            source = _source(installed(self.group)[name])
            raise InputError(f"plugin {name!r} of {source} failed: {describe(error)}") from error

    def values(self) -> Iterator[T]:
        """Yield the objects in the order of `names`; a plugin is loaded when its turn comes.

        Raises:
            InputError: as `__getitem__`.
        """
        yield from self.built_in.values()
        for name in self.names()[len(self.built_in) :]:
            yield self[name]
