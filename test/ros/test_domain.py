# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that meet on this host only: which domain, and over which devices."""

from contextlib import suppress
import fcntl
import os
from pathlib import Path
import tempfile

import pytest

from scenario_gen.base.ros_domain import DOMAINS, free_domain, this_host_only


def test_two_runs_get_two_domains(monkeypatch, tmp_path):
    monkeypatch.setattr(
        tempfile, "tempdir", str(tmp_path)
    )  # where no other run of the tests holds one
    with free_domain() as one, free_domain() as two:
        assert one != two
    with free_domain() as again:
        assert again == one


def test_domains_that_are_held_or_another_users_are_passed_over(monkeypatch):
    own = os.geteuid()
    with (
        tempfile.TemporaryDirectory() as name,
        (Path(name) / f"scenario_gen_domain_{DOMAINS[-1]}.lock").open("w") as held,
    ):
        fcntl.flock(held, fcntl.LOCK_EX)
        Path(name).chmod(0o1777)
        for domain in range(81, DOMAINS[-1]):
            file = Path(name) / f"scenario_gen_domain_{domain}.lock"
            file.touch()
            file.chmod(0o444 if domain > 90 else 0o000)
        monkeypatch.setattr(tempfile, "tempdir", name)
        if own == 0:  # whom no file mode stops
            os.seteuid(65534)
        try:
            with free_domain() as one, free_domain() as two:
                assert one != two and max(one, two) <= 80
        finally:
            os.seteuid(own)


def test_other_middleware_is_kept_on_this_host_by_ros_itself():
    assert this_host_only({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}) == {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"
    }
    for own in ({}, {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}):
        assert Path(this_host_only(own)["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()


@pytest.mark.dds
def test_nothing_is_said_beyond_the_loopback_device_nor_through_shared_memory(client):
    """As the kernel sees this process, which has a participant in it."""
    process = Path("/proc") / str(os.getpid())
    opened = set()
    for entry in (process / "fd").iterdir():
        with suppress(FileNotFoundError):  # the folder's own descriptor has gone by then
            opened.add(str(entry.readlink()))
    rows = [line.split() for line in (process / "net" / "udp").read_text().splitlines()[1:]]
    addresses = {row[1].partition(":")[0] for row in rows if f"socket:[{row[9]}]" in opened}
    assert addresses == {"0100007F"}  # 127.0.0.1
    other = [line.split() for line in (process / "net" / "udp6").read_text().splitlines()[1:]]
    assert not [row for row in other if f"socket:[{row[9]}]" in opened]
    assert "/dev/shm/fastrtps_" not in (process / "maps").read_text()
