# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The processes of a run of `mine` in a store: server, forwarder before it, scheduler, workers with their nannies, client."""

from contextlib import suppress
import importlib
import json
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time
from typing import Any, TypeAlias

from benchmarks._corpus_store import KEYS

QUIET: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
BUCKET = "kills"
Process: TypeAlias = subprocess.Popen[bytes]


def free_port() -> int:
    """Return a port that nobody listens at."""
    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return int(own.getsockname()[1])


def wait_for_port(port: int) -> None:
    """Wait until somebody listens at a port."""
    while True:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        time.sleep(0.05)


def end(process: Process | None) -> None:
    """Kill a process, if there is one, and all of its session."""
    if process is None:
        return
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


class Processes:
    """The processes of this benchmark; clients and workers reach the store through the forwarder alone."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.temporary = folder, folder / "tmp"
        self.server_port, self.port = free_port(), free_port()
        self.environment = os.environ | KEYS
        self.environment |= {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.port}",
            "TMPDIR": str(self.temporary),
            "DASK_DISTRIBUTED__SCHEDULER__WORKER_SATURATION": "1.0",
            "DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON": "{}",
            "OMP_NUM_THREADS": "1",
        }
        self.address, self.count = "", 0
        self.scheduler: Process | None = None
        self.forwarder: Process | None = None
        self.server: Process | None = None
        self.nannies: list[Process] = []

    def start(self) -> None:
        """Start all but clients."""
        self.temporary.mkdir()
        self.server = self._start(f"moto.server -p {self.server_port}")
        wait_for_port(self.server_port)
        self.start_forwarder()
        self.start_cluster()

    def start_forwarder(self) -> None:
        """Start what forwards to the server."""
        self.forwarder = self._start(f"benchmarks._kills_forwarder {self.port} {self.server_port}")
        wait_for_port(self.port)

    def start_cluster(self) -> None:
        """Start a scheduler, at another address than earlier ones, and two workers."""
        self.count += 1
        known = self.folder / f"scheduler-{self.count}.json"
        scheduler = "distributed.cli.dask_scheduler --port 0 --no-dashboard --scheduler-file"
        self.scheduler = self._start(scheduler, str(known), env=self.environment)
        while not known.exists() or not known.read_text().endswith("}"):
            time.sleep(0.05)
        self.address = json.loads(known.read_text())["address"]
        self.nannies = [self.start_worker(), self.start_worker()]

    def start_worker(self) -> Process:
        """Start a nanny, which starts a worker."""
        counts = "--nworkers 1 --nthreads 1 --no-dashboard --memory-limit 0 --local-directory"
        worker = f"distributed.cli.dask_worker {self.address} {counts}"
        return self._start(worker, str(self.folder), env=self.environment)

    @staticmethod
    def _start(module: str, *paths: str, env: dict[str, str] | None = None) -> Process:
        """Start a Python module with its arguments in its own session."""
        words = [sys.executable, "-m", *module.split(), *paths]
        return subprocess.Popen(words, start_new_session=True, env=env, **QUIET)

    def start_client(self, words: list[str], log: Path) -> Process:
        """Start the command line; what it prints goes to a file, after what is there."""
        with log.open("ab") as output:
            command = [sys.executable, "-m", "scenario_gen", *words, "--scheduler", self.address]
            streams: Any = QUIET | {"stdout": output, "stderr": output}
            return subprocess.Popen(
                command, start_new_session=True, env=self.environment, **streams
            )

    def end_cluster(self) -> None:
        """Kill scheduler and workers."""
        for process in (self.scheduler, *self.nannies):
            end(process)

    def close(self) -> None:
        """Kill all but clients."""
        self.end_cluster()
        end(self.forwarder)
        end(self.server)

    def store(self) -> Any:
        """Return a client of the server itself, which is never killed."""
        client = importlib.import_module("boto3").client
        return client(
            "s3",
            endpoint_url=f"http://127.0.0.1:{self.server_port}",
            aws_access_key_id="any",
            aws_secret_access_key="any",
            region_name="us-east-1",
        )


def worker_of(nanny: Process) -> int:
    """Return the worker's process, 0 where there is none at the moment."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != nanny.pid:
            with suppress(OSError):
                own = int(entry.name)
                if (
                    os.getsid(own) == nanny.pid
                    and b"spawn_main" in (entry / "cmdline").read_bytes()
                ):
                    return own
    return 0
