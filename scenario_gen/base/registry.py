# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is chosen by name (roads, planners, log and export formats, metrics): built-in, or of an installed package."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import entry_points, EntryPoint
from typing import cast, Generic, TypeVar

from scenario_gen.base.errors import describe, did_you_mean, InputError, ScenarioGenError

T = TypeVar("T")


@cache
def installed(group: str) -> Mapping[str, EntryPoint]:
    """Return the entry points of a group by name, sorted; none of them is loaded.

    Raises:
        InputError: two distributions use one name.
    """
    found: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=group), key=lambda entry: (entry.name, _source(entry))):
        if entry.name in found:
            raise InputError(
                f"plugins: {_source(found[entry.name])} and {_source(entry)} both have {group} {entry.name!r}"
            )
        found[entry.name] = entry
    return found


def _source(entry: EntryPoint) -> str:
    """Return the distribution of an entry point, with its version."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


class Registry(Generic[T]):
    """Things of one kind by name: the built-in ones, and those that installed packages declare as entry points of one group.

    Source: entry points, as the Python Packaging User Guide has them ("Creating and discovering plugins").
    """

    def __init__(self, group: str, built_in: Mapping[str, T], kind: type | None = None) -> None:
        """Make a registry; installed packages are looked at when a name is not built in, or when a list is wanted.

        Args:
            group: of the entry points, e.g. "scenario_gen.roads".
            built_in: by name, in the order in which they are listed and tried.
            kind: what an entry point must be an instance of; None: it must be callable.
        """
        self.group, self.kind, self.built_in = group, kind, built_in

    def names(self) -> tuple[str, ...]:
        """Return all names: the built-in ones first, the others sorted.

        Raises:
            InputError: two distributions use one name, or one uses a built-in name.
        """
        plugins = installed(self.group)
        for name in sorted(plugins.keys() & self.built_in.keys()):
            raise InputError(
                f"plugins: {_source(plugins[name])} has {self.group} {name!r}, which is built in; it must be renamed"
            )
        return (*self.built_in, *plugins)

    def __contains__(self, name: str) -> bool:
        """Return whether something has this name."""
        return name in self.built_in or name in self.names()

    def __getitem__(self, name: str) -> T:
        """Return what has this name.

        Raises:
            InputError: nothing has it, its plugin cannot be loaded or is of a wrong kind, or `names` fails.
        """
        if name in self.built_in:
            return self.built_in[name]
        if name not in self:
            raise InputError(
                f"{self.group} has no {name!r}; choose one of {', '.join(self.names())}{did_you_mean(name, self.names())}"
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
        """Name the plugin in an error of its code; what is built in answers for itself.

        Raises:
            InputError: the code of the plugin raised an error that is not ours, or wanted to leave the process.
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
        """Yield everything in the order of `names`; a plugin is loaded when its turn comes.

        Raises:
            InputError: as `__getitem__`.
        """
        yield from self.built_in.values()
        for name in self.names()[len(self.built_in) :]:
            yield self[name]
