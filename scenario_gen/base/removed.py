# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What earlier drafts had, and what replaces it. The table is emptied with the next release."""

REMOVED = {
    "library": "nothing replaces it; `scenario-gen generate` segments each encounter",
    "coverage": "`python -m benchmarks coverage` measures it",
    "regenerate": "the bag or the trajectories of a batch have the scenario; "
    "`scenario-gen generate` with the recorded seed and parameters makes it again",
    "--again": "`scenario-gen batch --bags all` keeps the scenarios in bags",
    "doctor": "`ros2 doctor` and `pip check` examine an installation",
    "--recombine": "it gained .01 of coverage; add recordings with --recording instead",
    **dict.fromkeys(
        ("s3://", "gs://", "gcs://", "abfs://", "abfss://", "az://", "http://", "https://"),
        "mount the store as a folder, or copy it with a tool such as rclone",
    ),
}
"""{command, option or scheme: what replaces it}."""
