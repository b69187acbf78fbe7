# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that meet on this host only: which domain, and over which devices."""

from contextlib import suppress
import fcntl
import os
from pathlib import Path

import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.base.ros_domain import free_domain, this_host_only


@pytest.fixture
def place(monkeypatch, tmp_path):
    """Return the folder of the reservations, where no other run of the tests has one."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / f"scenario_gen_domains_{os.geteuid()}"


def test_two_runs_get_two_domains(place):
    with free_domain() as one, free_domain() as two:
        assert one != two and place.stat().st_mode & 0o777 == 0o700
    with free_domain() as again:
        assert again == one


def test_a_reserved_domain_is_passed_over(place):
    with free_domain() as first:
        pass
    with (place / f"{first}.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with free_domain() as second:
            assert second != first


def test_no_other_account_reserves_domains(place):
    place.mkdir()
    place.chmod(0o777)
    with pytest.raises(InputError, match="other accounts may write"), free_domain():
        pass


def test_other_middleware_stays_on_host(monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert this_host_only() == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    assert Path(this_host_only()["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
    monkeypatch.delenv("RMW_IMPLEMENTATION")
    assert Path(this_host_only()["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()


@pytest.mark.dds
def test_traffic_stays_on_loopback(client):
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
