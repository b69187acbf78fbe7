# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mining in an object store, before a server that speaks S3: the same bytes as in folders, also when it fails."""

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
import os
from pathlib import Path
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from object_store import new_bucket, reached, read, serving
import pytest

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.base.errors import InputError
from scenario_gen.base.stores import below, place, upload
from scenario_gen.corpus.batch import BatchRequest, run_batch
from scenario_gen.corpus.find import coverage_lines, export_hits, find, make_again
from scenario_gen.corpus.library import build
from scenario_gen.corpus.mine import mine

pytestmark = pytest.mark.xdist_group("corpus")  # one archive for all


@pytest.fixture(scope="module")
def server():
    with serving() as address:
        yield address


@pytest.fixture
def bucket(server, archive, monkeypatch, request):
    """The archive in a bucket of its own, whose URL this is."""
    import boto3

    reached(monkeypatch, server)
    url = new_bucket(f"b{abs(hash(request.node.name))}")
    for path in archive.glob("*.csv"):
        boto3.client("s3").upload_file(str(path), url.removeprefix("s3://"), f"spmd/{path.name}")
    return url


def tables(out):
    """{name: bytes} of the tables of a corpus, in a folder or in a store; not of its text's, which name files."""
    if isinstance(out, Path):
        return {path.name: path.read_bytes() for path in (out / "encounters").glob("*.parquet")}
    return {one.name: read(one) for one in (out / "encounters").glob("*.parquet")}


def contents(out):
    """{name: bytes} of all files of a batch, or of a library, in a folder or in a store."""
    if isinstance(out, Path):
        return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("[!.]*") if path.is_file()}
    return {below(one, out): read(one) for one in out.rglob("[!.]*")}


def written(one):
    """When an object was written."""
    system, path = one.there()
    return system.info(path)["LastModified"]


def command(*words, **environment):
    """Run the command line in a process of its own."""
    words = [sys.executable, "-m", "scenario_gen", *words]
    return subprocess.Popen(words, env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize(("stored", "to_store"), [(True, True), (True, False), (False, True)])
def test_the_corpus_is_the_same_wherever_archive_and_corpus_lie(bucket, archive, corpus, tmp_path, stored, to_store):
    out = place(f"{bucket}/out", to_write=True) if to_store else tmp_path / "out"
    made = mine([place(f"{bucket}/spmd") if stored else archive], out)
    assert made.encounters == corpus[1].encounters and not made.failed
    assert tables(out) == tables(corpus[0])
    assert (out / "encounters.html").exists()


def test_what_is_done_is_not_done_again_and_another_archive_is_refused(bucket, archive):
    out = place(f"{bucket}/out")
    mine([place(f"{bucket}/spmd")], out)
    before = {one.url: written(one) for one in out.rglob("*.parquet")}
    mine([place(f"{bucket}/spmd")], out)
    assert {one.url: written(one) for one in out.rglob("*.parquet")} == before
    with pytest.raises(InputError, match="corpus of another archive"):
        mine([archive], out)


def test_a_batch_and_what_it_finds_are_the_same_in_a_store(bucket, corpus, tmp_path):
    stored, local, request = place(f"{bucket}/corpus"), tmp_path / "batch", BatchRequest(count=2, seed=5)
    upload(corpus[0] / "encounters", stored / "encounters")
    out = place(f"{bucket}/batch")
    made = run_batch(stored, ["straight"], out, request, templates=4)
    assert made.lines() == run_batch(corpus[0], ["straight"], local, request, templates=4).lines()
    assert made.scenarios and contents(out) == contents(local)
    assert find(out).rows == find(local).rows and coverage_lines(find(out), out) == coverage_lines(find(local), local)
    row = find(out).rows[0]
    assert make_again(out, row).sha256 == row["sha256"]
    namespaces = read_recording(export_hits(out, [row], tmp_path / "hits")).namespaces
    assert [one.hashes for one in namespaces.values()] == [(row["sha256"],)]
    remove(out / "cases" / "road=straight" / "part-00000.parquet")  # as if killed before its last object
    assert not find_or_none(out)
    run_batch(stored, ["straight"], out, request, templates=4)
    assert contents(out) == contents(local)
    with pytest.raises(InputError, match="batch of other count"):
        run_batch(stored, ["straight"], out, BatchRequest(count=3, seed=5), templates=4)


def find_or_none(out):
    """The scenarios of parts that are done."""
    try:
        return find(out).rows
    except InputError:
        return []


def remove(one):
    system, path = one.there()
    system.rm_file(path)


def test_a_library_is_the_same_in_a_store(bucket, corpus, tmp_path):
    stored, local = place(f"{bucket}/corpus"), tmp_path / "corpus"
    upload(corpus[0] / "encounters", stored / "encounters")
    shutil.copytree(corpus[0] / "encounters", local / "encounters")
    assert build(stored, most=4) == build(local, most=4)
    in_store = contents(stored / "library")
    assert in_store.pop("request.json") and in_store == contents(local / "library")
    assert build(stored, most=4).assigned  # is gone on with
    with pytest.raises(InputError, match="library of other most; remove it first"):
        build(stored, most=5)


class Failing(BaseHTTPRequestHandler):
    """Passes requests on to a server; some get 503 instead, some nothing."""

    protocol_version = "HTTP/1.1"
    to = ""
    requests = count(1)

    def log_message(self, *_):
        """Be silent."""

    def _pass(self):
        number = next(self.requests)
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        if number % 7 == 0:
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
            return
        if number % 5 == 0:
            self.send_response(503)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        headers = {name: value for name, value in self.headers.items() if name.lower() not in ("host", "connection")}
        headers.setdefault("Content-Type", "application/octet-stream")  # urllib's own is that of a form
        asked = Request(self.to + self.path, data=body or None, headers=headers, method=self.command)
        try:
            with urlopen(asked) as answer:
                status, found, data = answer.status, answer.headers, answer.read()
        except HTTPError as error:
            status, found, data = error.code, error.headers, error.read()
        self.send_response(status)
        for name, value in found.items():
            if name.lower() not in ("transfer-encoding", "connection", "content-length", "server", "date"):
                self.send_header(name, value)
        length = found.get("Content-Length", "0") if self.command == "HEAD" else str(len(data))
        self.send_header("Content-Length", length)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = _pass  # noqa: N815


@pytest.fixture
def failing(server, monkeypatch):
    """The same server behind one that fails: every fifth answer is 503, every seventh connection breaks."""
    import fsspec

    handler = type("To", (Failing,), {"to": server})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as proxy:
        thread = threading.Thread(target=proxy.serve_forever)
        thread.start()
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{proxy.server_address[1]}")
        fsspec.get_filesystem_class("s3").clear_instance_cache()
        yield
        proxy.shutdown()
        thread.join()


def test_a_store_that_fails_now_and_then_gives_the_same_bytes(bucket, failing, corpus):
    out = place(f"{bucket}/failing")
    made = mine([place(f"{bucket}/spmd")], out)
    assert not made.failed, made.failed[0]
    assert tables(out) == tables(corpus[0])


@pytest.mark.parametrize("seconds", [2.5, *(pytest.param(long, marks=pytest.mark.long) for long in (1.5, 3.5))])
def test_a_killed_run_is_gone_on_with(bucket, corpus, seconds):
    out = place(f"{bucket}/killed")
    words = ("mine", f"{bucket}/spmd", "--out", f"{bucket}/killed", "--workers", "1")
    with command(*words) as process:
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
    with command(*words) as process:
        _, said = process.communicate()
    assert process.returncode == 0, said
    assert tables(out) == tables(corpus[0])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("mine", "BUCKET/nothing", "--out", "BUCKET/out"), "s3://.*/nothing does not exist"),
        (("mine", "s3://no-such-bucket/a", "--out", "BUCKET/out"), "s3://no-such-bucket/a does not exist; check bucket and name"),
        (("mine", "BUCKET/spmd", "--out", "https://example.org/x"), "https is only read"),
        (("mine", "ftp://host/a", "--out", "BUCKET/out"), "ftp is not read or written"),
        (("batch", "BUCKET/out", "--roads", "straight", "--out", "x"), "out holds no encounters/"),
        (("library", "BUCKET/out"), "out holds no encounters/"),
        (("find", "BUCKET/out"), "out holds no scenarios"),
        (("roads", "BUCKET/a.xodr", "--out", "x.svg"), "a.xodr: a map takes a file or folder; copy it first"),
    ],
)
def test_what_cannot_be_is_said_in_a_line_with_its_url(bucket, tmp_path, words, said):
    import re

    with command(*(word.replace("BUCKET", bucket) for word in words)) as process:
        out, errors = process.communicate()
    assert process.returncode == 2 and re.search(said, " ".join(errors.split())), (out, errors)
    assert "Traceback" not in errors


def test_without_credentials_the_url_and_the_remedy_are_named(bucket, tmp_path):
    nobody = {"AWS_ACCESS_KEY_ID": "", "AWS_SECRET_ACCESS_KEY": "", "AWS_EC2_METADATA_DISABLED": "true", "HOME": str(tmp_path)}
    with command("mine", f"{bucket}/spmd", "--out", f"{bucket}/out", **nobody) as process:
        _, errors = process.communicate()
    assert process.returncode == 2 and f"{bucket}/spmd" in errors and "credentials" in errors, errors
