# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A server that speaks S3 (moto's), in a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
import socket
import subprocess
import sys
import time
from urllib.error import HTTPError
from urllib.request import urlopen

KEYS = {
    "AWS_ACCESS_KEY_ID": "any",
    "AWS_SECRET_ACCESS_KEY": "any",
    "AWS_DEFAULT_REGION": "us-east-1",
}


@contextmanager
def serving() -> Iterator[str]:
    """Give the address of a new server."""
    for _ in range(5):  # another process may take the port first
        with socket.socket() as own:
            own.bind(("127.0.0.1", 0))
            address = f"http://127.0.0.1:{own.getsockname()[1]}"
        command = [sys.executable, "-m", "moto.server", "-p", address.rpartition(":")[2]]
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as process:
            try:
                while process.poll() is None and not _answers(address):
                    time.sleep(0.1)
                if process.poll() is None:
                    yield address
                    return
            finally:
                process.kill()
    raise AssertionError("no server of moto could be started")


def _answers(address: str) -> bool:
    try:
        with urlopen(address, timeout=1.0):
            return True
    except HTTPError:
        return True
    except OSError:
        return False


def reached(monkeypatch, address: str) -> None:
    """Let this process and its children reach the server."""
    import fsspec

    for name, value in {**KEYS, "AWS_ENDPOINT_URL": address}.items():
        monkeypatch.setenv(name, value)
    fsspec.get_filesystem_class("s3").clear_instance_cache()


def new_bucket(name: str) -> str:
    """Return the URL of a new bucket."""
    import boto3

    boto3.client("s3").create_bucket(Bucket=name)
    return f"s3://{name}"


def read(found):
    """The content of an object."""
    system, path = found.file_system()
    return system.cat_file(path)
