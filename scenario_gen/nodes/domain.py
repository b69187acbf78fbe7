# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A ROS domain that nobody else on this machine uses."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import fcntl
from pathlib import Path
import socket
import tempfile

from scenario_gen.errors import RefusedError

DOMAINS = range(1, 102)  # above, the ports would be ephemeral ones


def _quiet(domain: int) -> bool:
    """Say whether the first participant's port of a domain is free (RTPS: 7400 + 250·domain + 10)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
        probe.bind(("", 7410 + 250 * domain))
        return True
    return False


@contextmanager
def free_domain() -> Iterator[int]:
    """Hold a domain id: no participant is in it, and no other run of ours takes it meanwhile.

    Raises:
        RefusedError: none is free.
    """
    for domain in reversed(DOMAINS):
        with (Path(tempfile.gettempdir()) / f"scenario_gen_domain_{domain}.lock").open("a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue  # another run of ours holds it
            if _quiet(domain):
                yield domain
                return
    raise RefusedError(f"no free ROS domain among {DOMAINS.start} to {DOMAINS.stop - 1}; end other ROS processes")
