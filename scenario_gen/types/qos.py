# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Quality of service of a topic."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quality:
    """Quality of service; publishers keep the last, subscribers with delayed acks keep all."""

    depth: int = 1
    reliable: bool = True
    transient_local: bool = True
    keep_all: bool = False
