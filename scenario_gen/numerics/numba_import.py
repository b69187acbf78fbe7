# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""numba without the file `.numba_config.yaml` of the working directory.

The file could name a folder of compiled code, which would then be run. numba reads the file when
it is imported, and again for each function that it compiles. Environment variables are read.
"""

from pathlib import Path

from scenario_gen.base.working_directory import ignored

with ignored():
    import numba
    import numba.extending

_reload_config = numba.core.config.reload_config


def _reload() -> None:
    if not Path(".numba_config.yaml").exists():
        _reload_config()


numba.core.config.reload_config = _reload

__all__ = ["numba"]
