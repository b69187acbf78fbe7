# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Random SIGKILLs of the commands that write results, each onto an earlier result.

One half of the kills comes at any time of a run, the other shortly after the first file of the new result is there. After each,
what the next command does first is done: the earlier result or the new one is whole then, and nothing else is left. Every tenth
time a whole run follows, as users start it.
`mine` with its store and its cluster is killed by `python -m benchmarks kills`.
"""

from collections import Counter
from collections.abc import Iterable
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
import hashlib
from io import StringIO
import json
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time

from figures import Figure, of_benchmark

from scenario_gen.__main__ import command as main
from scenario_gen.base.folders.scratch import PREFIX, sweep_beside
from scenario_gen.logs.synthetic import bundled

COUNT = 100
COMMANDS = ("generate", "evaluate", "regenerate")


@dataclass
class Target:
    """One command with two results that it may write to `out`."""

    command: str
    folder: Path
    sources: tuple[Path, Path]

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def words(self, which: int, out: Path) -> list[str]:
        """Return the command line that writes the first or the second result."""
        rest = {
            "generate": [str(bundled("c")), "--road", "straight", "--count", "2", "--seed", str(which)],
            "evaluate": [str(self.sources[which] / "bag")],
            "regenerate": [str(self.sources[0] / "bag"), str(which)],
        }[self.command]
        return [self.command, *rest, "--out", str(out)]

    def run_here(self, which: int) -> None:
        """Run in this process, silently."""
        sys.argv = ["scenario-gen", *self.words(which, self.out)]
        with redirect_stdout(StringIO()), suppress(SystemExit):
            main()

    def start(self, which: int) -> int:
        """Begin a run in a process of its own, forked from this one, which has all libraries loaded; return its id."""
        if pid := os.fork():
            return pid
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            self.run_here(which)
        finally:
            os._exit(0)

    def finish(self, which: int, out: Path | None = None) -> str:
        """Let a run come to its end, as a user starts it; return what is there then."""
        command = [sys.executable, "-m", "scenario_gen", *self.words(which, out or self.out)]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode:
            raise RuntimeError(f"{self.command}: {ended.stderr}")
        return digest(out or self.out)

    def is_alone(self) -> bool:
        """Say whether nothing is beside the result."""
        return [path.name for path in self.folder.iterdir()] == ["out"]

    def is_writing(self) -> bool:
        """Say whether a file of a new result is there."""
        with suppress(FileNotFoundError):  # it took its place while this looked
            return any(self.folder.glob(f"{PREFIX}*/new/out/*"))
        return False


def digest(folder: Path) -> str:
    """Return one SHA-256 of all names and bytes below."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        found.update(f"{path.relative_to(folder)}\0".encode() + (path.read_bytes() if path.is_file() else b""))
    return found.hexdigest()


def kill_once(target: Target, which: int, duration: float, chance: random.Random) -> str:
    """Begin a run and kill it; return when that was: "computing", "writing" or "ended" (before the kill)."""
    at_any_time = chance.random() < 0.5
    pid = target.start(which)
    if at_any_time:
        time.sleep(chance.uniform(0.0, duration))
    else:
        while not (ended := os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)) and not target.is_writing():
            time.sleep(0.001)
        if not ended:
            time.sleep(chance.uniform(0.0, 0.5 * duration))
    os.kill(pid, signal.SIGKILL)
    if os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) != -signal.SIGKILL:
        return "ended"
    return "writing" if target.is_writing() or not at_any_time else "computing"


def prepared(command: str, state: Path) -> tuple[Target, dict[str, int], float]:
    """Return a command's target, its two results by digest, and how long a run takes [s]."""
    target = Target(command, state / command, (state / "source_0", state / "source_1"))
    target.folder.mkdir(parents=True, exist_ok=True)
    for which, source in enumerate(target.sources):
        if command != "generate" and not (source / "bag").exists():
            Target("generate", state, target.sources).finish(which, source)
    known = {target.finish(which, state / f"{command}_{which}" / "out"): which for which in (0, 1)}
    target.run_here(0)  # so that this process has loaded everything
    started = time.monotonic()
    target.run_here(1)
    return target, known, time.monotonic() - started


def kills(command: str, state: Path, count: int, seed: int = 1) -> Counter[str]:
    """Kill so many runs of a command; return how often what was seen. What was done before counts, too."""
    log = state / f"{command}.json"
    seen: Counter[str] = Counter(json.loads(log.read_text())) if log.exists() else Counter()
    if seen["kills"] >= count:
        return seen
    target, known, duration = prepared(command, state)
    sweep_beside([str(target.out)])
    while seen["kills"] < count:
        chance = random.Random(f"{seed} {command} {seen.total()}")
        earlier = known[digest(target.out)]
        when = kill_once(target, 1 - earlier, duration, chance)
        killed = when != "ended"
        seen["kills" if killed else "ended before the kill"] += 1
        seen["while writing"] += when == "writing"
        seen["left something"] += not target.is_alone()
        sweep_beside([str(target.out)])  # a kill between the two renames leaves the earlier result beside its place
        found = known.get(digest(target.out))
        if found is None:
            raise RuntimeError(f"{target.out} is neither the earlier result nor the new one; look at it there")
        seen["whole"] += killed
        seen["new in place"] += killed and found != earlier
        if seen["kills"] % 10 == 0:
            target.finish(1 - found)
        seen["not cleaned"] += not target.is_alone() or digest(target.out) not in known
        log.write_text(json.dumps(seen))
    return seen


def run(state: Path) -> Iterable[Figure]:
    """Kill every command COUNT times."""
    for command in COMMANDS:
        seen = kills(command, state, COUNT)
        told = (
            f"{seen['whole']} of {seen['kills']} whole ({seen['while writing']} killed while writing, the new one in place after "
        )
        told += f"{seen['new in place']})"
        asked = f"{COUNT} kills, one of the two results whole after each"
        yield Figure(f"a kill of `{command} --out` loses nothing", asked, told, seen["whole"] == seen["kills"] >= COUNT)
        told = f"{seen['left something']} left something, {seen['not cleaned']} still there after the next run"
        yield Figure(f"the next `{command}` removes what a killed one left", "nothing left", told, not seen["not cleaned"])
    yield from of_benchmark("kills", state / "mine.json")
