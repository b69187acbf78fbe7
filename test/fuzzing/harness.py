# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fuzzing: readers get damaged inputs, and nothing but an error of ours may come out, in little time and little memory.

A target is a reader with valid inputs and ways to damage them (modules `targets_*.py`). Input number k of a target is made from
k alone, so a failure can be made again. Executions happen in a child process that is forked
once and tells its parent which number it is at; so a crash of native code or a hang is seen and known by its input.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import faulthandler
from fnmatch import fnmatch
import gc
import importlib
import json
import multiprocessing
from multiprocessing.sharedctypes import Synchronized
import os
from pathlib import Path
import random
import re
import resource
import shutil
import signal
import tempfile
import time
import traceback
from typing import TextIO
import warnings

from support.lengths import DATA

from scenario_gen.base.errors import MAX_INPUT_CHARACTERS, ScenarioGenError, UnforeseenError

HERE = Path(__file__).resolve().parent
CRASHES = DATA.parent / "crashes"
SECONDS = 5.0  # of CPU that one execution may take
MEMORY = 1 << 30  # bytes that the process may hold at its peak
HEADROOM = (
    3 << 30
)  # bytes of address space that an execution may ask for: more is refused, so that the machine lives on
SILENT = 300  # s that an execution may take: after that it hangs outside of Python

Mutator = Callable[[random.Random, bytes, Sequence[bytes]], bytes]


@dataclass(frozen=True)
class Target:
    """A reader to fuzz.

    Attributes:
        name: for people and for the names of files.
        seeds: valid inputs; gets an empty folder to make them in.
        run: reads an input; gets an empty folder to put it in. An error of ours is as good as a result.
        mutators: ways to damage an input: (random numbers, input, all seeds) -> input.
        crashes: globs of files below shared/crashes that are seeds, too.
        named: what every message must hold, e.g. the file's name; not asked of messages about a parameter.
    """

    name: str
    seeds: Callable[[Path], Sequence[bytes]]
    run: Callable[[bytes, Path], object]
    mutators: Sequence[Mutator]
    crashes: Sequence[str] = ()
    named: str = ""


@dataclass
class Record:
    """How often a target was executed, and what came out where nothing but an error of ours may, by its signature."""

    executions: int = 0
    failures: dict[str, str] = field(default_factory=dict)


class OverTimeError(BaseException):
    """An execution took too long; no handler of `Exception` may swallow it."""


def targets() -> dict[str, Target]:
    """Return all targets by name."""
    names = sorted(path.stem for path in HERE.glob("targets_*.py"))
    modules = [importlib.import_module(f"fuzzing.{name}") for name in names]
    return {target.name: target for module in modules for target in module.TARGETS}


def corpus(target: Target, *, found: bool = True) -> list[bytes]:
    """Return the valid inputs of a target, files made with faults that once broke it, and if asked for those found."""
    from fuzzing import broken

    with tempfile.TemporaryDirectory() as folder:
        seeds = list(target.seeds(Path(folder)))
    seeds += [
        make()
        for name, make in broken.FILES.items()
        if any(fnmatch(name, pattern) for pattern in target.crashes)
    ]
    return seeds + (found_crashes(target) if found else [])


def found_crashes(target: Target) -> list[bytes]:
    """Return the files that once broke a target, where they are."""
    files = sorted(
        file for pattern in target.crashes for file in CRASHES.glob(pattern) if file.is_file()
    )
    return [file.read_bytes() for file in files]


def damaged(target: Target, seeds: Sequence[bytes], number: int) -> bytes:
    """Return input `number` of a target: first the seeds as they are, then damaged ones."""
    if number < len(seeds):
        return seeds[number]
    rng = random.Random(f"{target.name}/{number}")
    data = rng.choice(seeds)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        data = rng.choice(target.mutators)(rng, data, seeds)
    return data


def execute(
    target: Target, data: bytes, folder: Path, most: int = MEMORY
) -> tuple[str, str] | None:
    """Run a target on one input in this process; return signature and message of what must not come out, or None."""
    folder.mkdir()
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        target.run(data, folder)
    except (
        UnforeseenError
    ) as error:  # what a user gets instead of a traceback is a finding all the same
        return signature(error.__cause__ or error), str(error)
    except ScenarioGenError as error:
        said = str(error)
        if not 0 < len(said) <= MAX_INPUT_CHARACTERS:
            return "LongMessage", f"{len(said)} characters: {said[:200]}"
        if target.named not in said and not said.startswith("parameter "):
            return "NoPlace", said
    except (Exception, OverTimeError) as error:
        return signature(error), str(error)[:MAX_INPUT_CHARACTERS]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        shutil.rmtree(folder, ignore_errors=True)
    return ("Memory", f"{peak() / 2**20:.0f} MiB at the peak") if peak() > most else None


def peak() -> int:
    """Return the most memory that this process has held so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def signature(error: BaseException) -> str:
    """Return kind and place of an error: where it left our code, and where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    places = [f"{Path(frame.filename).name}:{frame.lineno} {frame.name}" for frame in frames]
    ours = [
        place
        for place, frame in zip(places, frames, strict=True)
        if re.search("scenario_gen/|msg_conventions/", frame.filename)
    ]
    return f"{type(error).__name__} @ {(ours or places)[-1]} <- {places[-1]}"


def over_time(_signal: int, _frame: object) -> None:
    """Interrupt an execution."""
    raise OverTimeError(f"more than {SECONDS:g} s")


def child(
    target: Target,
    seeds: Sequence[bytes],
    last: int,
    until: float,
    parent: int,
    number: "Synchronized[int]",
    out: TextIO,
) -> None:
    """Execute inputs from `number` on to before `last`, or up to a time, or while the parent lives; failures go to a file."""
    warnings.simplefilter("ignore")
    os.fsync = lambda _: None  # slow, and nothing here outlives the machine
    gc.freeze()  # to look for garbage in what the parent has loaded would copy all of it
    faulthandler.disable()  # pytest's: the parent says what happened
    signal.signal(signal.SIGPROF, over_time)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + HEADROOM, size + HEADROOM))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    most = max(MEMORY, peak() + MEMORY // 2)  # under pytest the parent may hold much already
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    with tempfile.TemporaryDirectory() as scratch:
        while number.value < last and time.monotonic() < until and os.getppid() == parent:
            signal.alarm(SILENT)  # ends the process: it hangs outside of Python
            found = execute(
                target, damaged(target, seeds, number.value), Path(scratch) / "input", most
            )
            if found:
                print(json.dumps([number.value, *found]), file=out, flush=True)
            number.value += 1
            if peak() > most:  # it stays: a new child has its own
                return


def batch(
    target: Target, seeds: Sequence[bytes], first: int, last: int, until: float
) -> tuple[int, Sequence[tuple[int, str, str]]]:
    """Fork a child for some executions; return the number to go on at, and its failures as (number, signature, message)."""
    context = multiprocessing.get_context("fork")
    number = context.Value("q", first, lock=False)
    with tempfile.TemporaryFile("w+") as out:
        process = context.Process(
            target=child, args=(target, seeds, last, until, os.getpid(), number, out)
        )
        process.start()
        process.join()
        out.seek(0)
        found = [tuple(json.loads(line)) for line in out]
    if process.exitcode:
        found.append(
            (number.value, f"exit code {process.exitcode}", "a signal, if it is negative")
        )
        number.value += 1
    return number.value, found


def fuzz(
    target: Target,
    folder: Path,
    executions: int,
    seconds: float,
    seeds: Sequence[bytes] | None = None,
) -> Record:
    """Fuzz a target until it has had so many executions or so much time.

    Args:
        target: the reader.
        folder: it keeps the first input of each signature of a failure.
        executions: at most so many.
        seconds: at most so long (real time; ends after the execution that runs).
        seeds: its corpus, where that has been made already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    seeds = corpus(target) if seeds is None else seeds
    record, until = Record(), time.monotonic() + seconds
    while record.executions < executions and time.monotonic() < until:
        record.executions, found = batch(target, seeds, record.executions, executions, until)
        for number, kind, message in found:
            if kind in record.failures:
                continue
            file = folder / f"{target.name}_{re.sub(r'[^0-9A-Za-z]+', '_', kind)[:100]}"
            file.write_bytes(damaged(target, seeds, number))
            record.failures[kind] = f"{message} ({file})"
    return record
