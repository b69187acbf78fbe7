"""A ROS domain of its own for each module, and a client in it."""

from collections.abc import Iterator

import pytest
from suite_processes import Client


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    from scenario_gen.nodes.domain import free_domain

    with free_domain() as number:
        yield number


@pytest.fixture
def client(domain: int) -> Iterator[Client]:
    made = Client(domain)
    yield made
    made.close()
