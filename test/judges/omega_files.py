# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Judge traces of OSI by omega-prime's reader and validator, in the environment of requirements/judges-omega.lock.

`python omega_files.py FOLDER`; one JSON object on the last line: files, faults by file, maps that it reads, planted faults
that it misses.
"""

import json
from pathlib import Path
import sys
import tempfile

import betterosi
import omega_prime

PLANTED = ("length", "yaw", "gap")


def fault_of(path):
    """Return what omega-prime says against a file, "" if nothing."""
    try:
        omega_prime.Recording.from_file(path, validate=True)
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:200]}"
    return ""


def with_fault(source, target, fault):
    """Copy a trace with a negative length, a heading beyond π, or a vehicle that is away for an instant."""
    with betterosi.Writer(target) as writer:
        for k, message in enumerate(betterosi.read(source, return_ground_truth=True)):
            if not isinstance(message, betterosi.GroundTruth):
                continue
            if k == 10:
                thing = message.moving_object[0]
                if fault == "length":
                    thing.base.dimension.length = -1.0
                elif fault == "yaw":
                    thing.base.orientation.yaw = 7.0
                else:
                    message.moving_object = message.moving_object[1:]
            writer.add(
                message,
                topic="ground_truth",
                log_time=message.timestamp.seconds * 10**9 + message.timestamp.nanos,
            )


def main(folder):
    paths = sorted(folder.rglob("*.mcap"))
    faults = {str(path.relative_to(folder)): fault for path in paths if (fault := fault_of(path))}
    drawn = sum(
        type(omega_prime.Recording.from_file(path, parse_map=True).map).__name__ == "MapOdr"
        for path in paths[:5]
    )
    missed = []
    with tempfile.TemporaryDirectory() as scratch:
        for fault in PLANTED:
            target = Path(scratch) / f"{fault}.mcap"
            with_fault(paths[0], target, fault)
            missed += [] if fault_of(target) else [fault]
    print(
        json.dumps(
            {
                "files": len(paths),
                "faults": faults,
                "maps": drawn,
                "of": len(paths[:5]),
                "missed": missed,
            }
        ),
        flush=True,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
