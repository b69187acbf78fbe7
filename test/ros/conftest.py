# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A ROS domain of its own for each module, a client in it, and nodes as their executables start them."""

from collections.abc import Iterator

import pytest
from support.node_server import Forked, start_nodes
from support.suite_processes import Client


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    from scenario_gen.base.ros_domain import free_domain

    with free_domain() as number:
        yield number


@pytest.fixture
def client(domain: int) -> Iterator[Client]:
    made = Client(domain)
    yield made
    made.close()


@pytest.fixture
def start(domain):
    """Start a node as its executable does; what is still running at the end is killed."""
    started = []

    def run(node: str, *more: str, **parameters: object) -> Forked:
        words = [
            *more,
            *(word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")),
        ]
        process = start_nodes(node, "--ros-args", *words, ROS_DOMAIN_ID=str(domain))
        started.append(process)
        return process

    yield run
    for process in started:
        process.kill()
        process.communicate()
