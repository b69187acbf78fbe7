# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Known vulnerabilities of every locked package: `make audit`, in an environment of its own.

pip-audit by itself says success where the advisory service knows none of the packages; here each locked package must have
been looked up. Exit code 0: none has a known vulnerability; 1: some have; 2: the audit could not be made in full.
"""

from collections.abc import Mapping, Sequence
import json
import subprocess
import sys
from typing import Any

RUN = ("-m", "pip_audit", "--require-hashes", "--disable-pip", "--format", "json", "--progress-spinner", "off")
CLEAN, VULNERABLE, NOT_MADE = 0, 1, 2


def judge(lock: str, code: int, out: str, err: str) -> tuple[int, str]:
    """Return the exit code and a plain sentence for what pip-audit said of one lock file.

    Args:
        lock: the file.
        code: pip-audit's own exit code.
        out: its JSON document.
        err: what else it said.
    """
    try:
        packages: Sequence[Mapping[str, Any]] = json.loads(out)["dependencies"]
    except (ValueError, KeyError, TypeError):
        why = next((line.strip() for line in reversed(err.splitlines()) if line.strip()), "it said nothing")
        return NOT_MADE, (
            f"{lock} was not audited: pip-audit ended with {code} ({why[:200]}). "
            "It needs the advisory service on the network; try again where that can be reached."
        )
    skipped = [package for package in packages if "skip_reason" in package]
    if skipped or not packages:
        some = "; ".join(str(package["skip_reason"]) for package in skipped[:2])
        return NOT_MADE, (
            f"{lock} was not audited: {len(skipped)} of {len(packages)} packages were skipped ({some[:200] or 'it lists none'}). "
            "Try again where the advisory service can be reached and knows them."
        )
    found = [f"{package['name']} {package['version']}: {known['id']}" for package in packages for known in package["vulns"]]
    if found or code:
        return VULNERABLE, f"{lock}: {len(found)} known vulnerabilities among {len(packages)} packages: {'; '.join(found)}"
    return CLEAN, f"{lock}: {len(packages)} packages, none with a known vulnerability"


def main(locks: Sequence[str]) -> int:
    """Audit the lock files; the worst answer is the exit code."""
    worst = CLEAN
    for lock in locks:
        run = subprocess.run([sys.executable, *RUN, "-r", lock], capture_output=True, text=True, check=False)
        code, sentence = judge(lock, run.returncode, run.stdout, run.stderr)
        print(sentence, file=sys.stderr if code else sys.stdout, flush=True)
        worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
