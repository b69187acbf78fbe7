# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An unused ROS domain on this machine, and an environment restricted to it."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import socket
import tempfile

from filelock import FileLock, Timeout

from scenario_gen.base.errors import RefusedError
from scenario_gen.base.folders import own_folder
from scenario_gen.base.signals import environment_set

DOMAINS = range(1, 102)  # higher domains would use ephemeral ports
CHECKED_PARTICIPANTS_COUNT = 20  # the first participants may have ended while a later one lives


def _quiet(domain: int) -> bool:
    """Return whether the ports of a domain's first participants are free."""
    first = 7410 + 250 * domain  # RTPS: 7400 + 250 · domain + 10 + 2 · participant
    with suppress(OSError):
        for port in range(first, first + 2 * CHECKED_PARTICIPANTS_COUNT, 2):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("", port))
        return True
    return False


@contextmanager
def free_domain() -> Iterator[int]:
    """Reserve a domain id without participants.

    The reservations are those of this account; accounts begin with different domains.

    Raises:
        InputError: another account has taken the folder of the reservations.
        RefusedError: no domain is free.
    """
    account = os.geteuid()
    place = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir())
    folder = place / f"scenario_gen_domains_{account}"
    own_folder(folder)
    for k in range(len(DOMAINS)):
        domain = DOMAINS[-1 - (account + k) % len(DOMAINS)]
        lock = FileLock(folder / f"{domain}.lock", blocking=False, thread_local=False)
        try:
            lock.acquire()
        except Timeout:  # reserved
            continue
        try:
            if _quiet(domain):
                yield domain
                return
        finally:
            lock.release()
    raise RefusedError(
        f"no free ROS domain among {DOMAINS.start} to {DOMAINS.stop - 1}; end other ROS processes"
    )


@contextmanager
def own_domain() -> Iterator[int]:
    """Run this process and its children in a domain of their own, on this host.

    Raises:
        RefusedError: no domain is free.
    """
    with (
        free_domain() as domain,
        environment_set({**this_host_only(), "ROS_DOMAIN_ID": str(domain)}),
    ):
        yield domain


def this_host_only() -> dict[str, str]:
    """Return the variables that restrict a process to communication on this host, in any domain.

    Fast DDS then uses UDP on the loopback device. Its shared memory, which ROS's range LOCALHOST
    includes, considers a process dead that did not run for a second, and can then deadlock living
    ones (Fast DDS issue 6484). This happened in 3 of 40 runs of 40 callers on two busy cores.
    """
    if not os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    profile = str(Path(__file__).resolve().parents[1] / "resources" / "loopback.xml")
    return {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",  # the profile decides
        "FASTRTPS_DEFAULT_PROFILES_FILE": profile,  # Jazzy's Fast DDS
        "FASTDDS_DEFAULT_PROFILES_FILE": profile,  # later versions
    }
