# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""In CI a skipped test has failed, but for the named exceptions: what needs `launch`, what needs recorded data."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

CASES = {
    "test_exception.py": "import pytest\nfrom skips import NO_LAUNCH\npytest.importorskip('no_launch', reason=NO_LAUNCH)\n",
    "test_records.py": "import pytest\nfrom skips import NO_RECORDS\ndef test_it():\n    pytest.skip(NO_RECORDS)\n",
    "test_one.py": "import pytest\ndef test_it():\n    pytest.skip('no disk')\n",
    "test_module.py": "import pytest\npytest.skip('no reason', allow_module_level=True)\n",
}


@pytest.mark.parametrize(("ci", "said"), [(True, "1 failed, 2 skipped, 1 error"), (False, "4 skipped")])
def test_only_what_needs_launch_or_records_may_be_skipped_in_ci(tmp_path, ci, said):
    own = {name: Path(__file__).with_name(name).read_text() for name in ("conftest.py", "lengths.py", "skips.py")}
    for name, text in (own | CASES).items():
        (tmp_path / name).write_text(text)
    environment = {name: value for name, value in os.environ.items() if name not in ("CI", "PYTEST_ADDOPTS")}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--continue-on-collection-errors", str(tmp_path)]
    environment |= {"CI": "true"} if ci else {}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert said in run.stdout, run.stdout + run.stderr
    assert bool(run.returncode) is ci
