# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A server on this machine that speaks S3, and the CPU time of commands that use it."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import socket
import subprocess
import sys
import time
from urllib.error import HTTPError, URLError
from urllib.request import urlopen

KEYS = {
    "AWS_ACCESS_KEY_ID": "any",
    "AWS_SECRET_ACCESS_KEY": "any",
    "AWS_DEFAULT_REGION": "us-east-1",
}
START = "from scenario_gen.base.stores import place; import scenario_gen.corpus.mine, sys; place(sys.argv[1]).exists()"


@contextmanager
def bucket_with(archive: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Give the URL of a bucket that holds an archive's text below `archive/`, and the environment by which it is reached."""
    import boto3  # type: ignore[import-untyped]

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    command = [sys.executable, "-m", "moto.server", "-p", str(port)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
        try:
            _wait(address, server)
            client = boto3.client(
                "s3", endpoint_url=address, aws_access_key_id="any", aws_secret_access_key="any"
            )
            client.create_bucket(Bucket="bench")
            for path in sorted(archive.glob("*.csv")):
                client.upload_file(str(path), "bench", f"archive/{path.name}")
            yield "s3://bench", {**KEYS, "AWS_ENDPOINT_URL": address}
        finally:
            server.kill()


def _wait(address: str, server: "subprocess.Popen[bytes]") -> None:
    """Return when a server answers.

    Raises:
        RuntimeError: it ended.
    """
    while server.poll() is None:
        try:
            with urlopen(address, timeout=1.0):
                return
        except HTTPError:
            return
        except (URLError, OSError):
            time.sleep(0.1)
    raise RuntimeError("the server of the object store ended; is moto[server] installed?")


def spent(words: list[str], environment: dict[str, str]) -> float:
    """Return CPU seconds of a Python command and of the processes that it waits for; a server that runs does not count."""
    before = os.times()
    subprocess.run(
        [sys.executable, *words],
        env={**os.environ, **environment},
        check=True,
        capture_output=True,
    )
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )
