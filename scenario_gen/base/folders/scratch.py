# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of intermediate files: removed with the command, also by Ctrl-C; the next command removes those of killed ones.

A scratch folder is a claim (`claim.py`) on a result that never takes its place, so its lock shows whether its process lives.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import tempfile

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders.claim import alone, Claim, claim, GUARD, PREFIX, settle
from scenario_gen.base.interrupts import ending, uninterrupted

NAME = "scratch"
DEPTHS = ("*/", "*/*/")  # at which a corpus and a batch write below their own folder


@contextmanager
def scratch(parent: Path, *, swept: bool = False) -> Iterator[Path]:
    """Yield an empty folder in `parent`, which only this user may enter, and remove it at the end.

    Args:
        parent: the folder.
        swept: whether others remove what killed processes left there; else `parent` is listed, whatever it holds.

    Raises:
        OSError: there is no room, or no right to write.
    """
    claims: list[Claim] = []

    def clean_up() -> None:
        while claims:
            claims.pop().release()

    with ending(clean_up):
        try:
            with uninterrupted():
                if not swept:
                    sweep(parent)
                claims.append(_claimed(parent / NAME))
                own = claims[0]
                own.folder.chmod(0o700)
            yield own.new
        finally:
            with uninterrupted():
                clean_up()


def _claimed(place: Path) -> Claim:
    """Return a claim; a second one if another process removed the first between its creation and its lock."""
    with suppress(FileNotFoundError, BlockingIOError):
        return claim(place)
    return claim(place)


def sweep(folder: Path) -> None:
    """Remove the leftovers of killed processes in a folder, unless they cannot be removed or another process holds them."""
    with suppress(OSError, InputError):
        with os.scandir(folder) as listing:
            left = any(entry.name.startswith(PREFIX) or entry.name == GUARD for entry in listing)
        if left:
            with alone(folder, patience=0.0):
                settle(folder / GUARD)


def sweep_tree(folder: Path) -> None:
    """`sweep` a folder and those in it; to be called `alone`."""
    for above in sorted({path.parent for path in folder.rglob(f"{PREFIX}*")}):
        settle(above / GUARD)


def sweep_beside(words: Iterable[str]) -> None:
    """`sweep` every folder among a command's arguments, with those in it, the one above, and that of temporary files."""
    folders = {Path(tempfile.gettempdir())}
    for word in words:
        with suppress(OSError, ValueError):
            path = Path(word.partition("=")[2] if word.startswith("-") else word).absolute()
            folders |= {above for above in (path, path.parent) if above.is_dir()}
            folders |= {left.parent for depth in DEPTHS for left in path.glob(f"{depth}{PREFIX}*")}
    for folder in sorted(folders):
        sweep(folder)
