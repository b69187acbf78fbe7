# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A ROS domain that nobody else on this machine uses, and the environment of processes that meet in it and nowhere else."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import socket
import tempfile

from filelock import FileLock, Timeout

from scenario_gen.base.errors import RefusedError

DOMAINS = range(1, 102)  # above, the ports would be ephemeral ones
PARTICIPANTS = 20  # of which one that was left over may be any: the first ones may have ended


def _quiet(domain: int) -> bool:
    """Say whether the ports of a domain's first participants are free (RTPS: 7400 + 250·domain + 10 + 2·participant)."""
    with suppress(OSError):
        for port in range(7410 + 250 * domain, 7410 + 250 * domain + 2 * PARTICIPANTS, 2):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("", port))
        return True
    return False


@contextmanager
def free_domain() -> Iterator[int]:
    """Hold a domain id: no participant is in it, and no other run of ours takes it meanwhile.

    Raises:
        RefusedError: none is free.
    """
    for domain in reversed(DOMAINS):
        lock = FileLock(
            Path(tempfile.gettempdir()) / f"scenario_gen_domain_{domain}.lock",
            blocking=False,
            thread_local=False,
        )
        try:
            lock.acquire()
        except (OSError, Timeout):  # held, or another user's, whose domain is passed over
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
    """Put this process and its children in a domain of their own, on this host.

    Raises:
        RefusedError: none is free.
    """
    with free_domain() as domain:
        own = {**this_host_only(), "ROS_DOMAIN_ID": str(domain)}
        before = {name: os.environ.get(name) for name in own}
        os.environ.update(own)
        try:
            yield domain
        finally:
            for name in own:
                os.environ.pop(name, None)
            os.environ.update({name: value for name, value in before.items() if value is not None})


def this_host_only(environment: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return the variables that let a process meet others on this host only, whatever its domain.

    With Fast DDS they talk over UDP on the loopback device. Its shared memory, which ROS's own range LOCALHOST includes, takes a
    process that did not run for a second for dead, and what it does then can end in a deadlock of the living (Fast DDS issue
    6484): so it did in 3 of 40 storms of 40 callers beside six busy loops on two cores.
    """
    if not environment.get("RMW_IMPLEMENTATION", "rmw_fastrtps").startswith("rmw_fastrtps"):
        return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    profile = str(Path(__file__).resolve().parents[1] / "resources" / "loopback.xml")
    names = (
        "FASTRTPS_DEFAULT_PROFILES_FILE",
        "FASTDDS_DEFAULT_PROFILES_FILE",
    )  # of Jazzy's Fast DDS, and of the next
    return {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        **dict.fromkeys(names, profile),
    }  # all is left to the profile
