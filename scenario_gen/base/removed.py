# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What earlier drafts had, and what replaces it. The table is emptied with the next release."""

from scenario_gen.base.errors import InputError

_TABLE = "convert it to a table with columns vehicle, time, x, y or lat, lon, or write a plugin"

REMOVED = {
    "library": "nothing replaces it; `scenario-gen generate` segments each encounter",
    "coverage": "`python -m benchmarks coverage` measures it",
    "regenerate": "the bag or the trajectories of a batch have the scenario; "
    "`scenario-gen generate` with the recorded seed and parameters makes it again",
    "--again": "`scenario-gen batch --bags all` keeps the scenarios in bags",
    "--compare": "`python -m benchmarks evaluation` compares with other changepoints",
    "compare": "the two evaluation.json have the figures and their intervals",
    "validate": "`scenario-gen evaluate` checks every scenario of a bag, then measures it",
    "parameters": "`scenario-gen --parameters` lists them",
    **dict.fromkeys(
        ("compact", "--compact"),
        "the parts of a batch are large; DuckDB's `COPY (FROM 'scenarios/**/*.parquet') TO "
        "'scenarios.parquet'` merges them",
    ),
    "reindex": "a bag that was cut off is read up to the cut; `mcap recover` and then "
    "`ros2 bag reindex` make a whole bag of it",
    "doctor": "`ros2 doctor` and `pip check` examine an installation",
    "--recombine": "it gained .01 of coverage; add recordings with --recording instead",
    **dict.fromkeys(
        ("s3://", "gs://", "gcs://", "abfs://", "abfss://", "az://", "http://", "https://"),
        "mount the store as a folder, or copy it with a tool such as rclone",
    ),
    "log.format=osi": _TABLE,
    "log.format=openscenario": f"OpenSCENARIO is only exported; {_TABLE}",
    ".xosc": f"OpenSCENARIO is only exported; {_TABLE}",
    "log.format=tum": _TABLE,
    ".tum": _TABLE,
    "log.format=gpx": _TABLE,
    ".gpx": _TABLE,
    "log.format=nmea": _TABLE,
    ".nmea": _TABLE,
    "log.format=kitti": _TABLE,
    "--to osi": "export openscenario, commonroad or scenarionet",
}
"""{command, option, scheme, value or suffix of files: what replaces it}."""


def refuse_removed(name: str, place: str = "") -> None:
    """Refuse what was removed.

    Args:
        name: as a user writes it: a command, an option, `log.format=value`, or a suffix.
        place: the file or option that needs it, for the message; empty: the name.

    Raises:
        InputError: it was removed; the message says what replaces it.
    """
    if name in REMOVED:
        subject = f"{place}: {name}" if place else name
        raise InputError(f"{subject} was removed: {REMOVED[name]}")
