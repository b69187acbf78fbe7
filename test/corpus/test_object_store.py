# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mining in an object store, before a server that speaks S3: the same bytes as in folders, also when it fails."""

from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count
from pathlib import Path
import re
import socket
import subprocess
import sys
import threading
import time

import boto3
import fsspec
import pytest
from support.object_store import new_bucket, reached, read, serving
from typer.testing import CliRunner

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.base.errors import InputError
from scenario_gen.base.stores import place, relative_name, upload
from scenario_gen.cli.commands import app
from scenario_gen.corpus.batch import run_batch
from scenario_gen.corpus.compact import compact
from scenario_gen.corpus.find import coverage_lines, export_hits, find
from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.parts import BatchRequest

pytestmark = pytest.mark.xdist_group("corpus")  # one archive for all


@pytest.fixture(scope="module")
def server():
    with serving() as address:
        yield address


@pytest.fixture
def bucket(server, archive, monkeypatch, request):
    """The archive in a bucket of its own, whose URL this is."""
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
    """{name: bytes} of all files of a batch in a folder or in a store."""
    if isinstance(out, Path):
        return {
            path.relative_to(out).as_posix(): path.read_bytes()
            for path in out.rglob("[!.]*")
            if path.is_file()
        }
    return {relative_name(one, out): read(one) for one in out.rglob("[!.]*")}


def written(one):
    """When an object was written."""
    system, path = one.file_system()
    return system.info(path)["LastModified"]


@pytest.mark.parametrize("to_store", [True, pytest.param(False, marks=pytest.mark.long)])
def test_the_corpus_is_the_same_wherever_archive_and_corpus_lie(
    bucket, archive, corpus, tmp_path, to_store
):
    """And what is done is not done again."""
    out = place(f"{bucket}/out", to_write=True) if to_store else tmp_path / "out"
    made = mine([place(f"{bucket}/spmd")], out)
    assert made.encounters == corpus[1].encounters and not made.failed
    assert tables(out) == tables(corpus[0])
    assert (out / "encounters.html").exists()
    if to_store:
        before = {one.url: written(one) for one in out.rglob("*.parquet")}
        mine([place(f"{bucket}/spmd")], out)
        assert {one.url: written(one) for one in out.rglob("*.parquet")} == before


def test_a_batch_and_what_it_finds_are_the_same_in_a_store(bucket, corpus, tmp_path):
    stored, local, request = (
        place(f"{bucket}/corpus"),
        tmp_path / "batch",
        BatchRequest(count=2, seed=5, bags="hits", hits="index = 0"),
    )
    upload(corpus[0] / "encounters", stored / "encounters")
    out = place(f"{bucket}/batch")
    made = run_batch(stored, ["corridor"], out, request, templates=2)
    assert made.lines() == run_batch(corpus[0], ["corridor"], local, request, templates=2).lines()
    assert made.scenarios and contents(out) == contents(local)
    assert find(out).rows == find(local).rows and coverage_lines(find(out), out) == coverage_lines(
        find(local), local
    )
    rows = find(out).rows
    assert export_hits(out, rows, tmp_path / "hits") == len(rows)
    namespaces = read_recording(tmp_path / "hits").namespaces
    assert [one.hashes for one in namespaces.values()] == [(row["sha256"],) for row in rows]
    with pytest.raises(InputError, match="batch with other seed"):
        run_batch(stored, ["corridor"], out, BatchRequest(count=2), templates=2)
    run_batch(stored, ["corridor"], out, request, templates=3)
    before = find(out).rows
    assert compact(out)[2] == [] and find(out).rows == before
    assert not list((out / "cases").rglob("part-*"))
    remove(
        out / "cases" / "road=corridor" / "parts-00000-00001.parquet"
    )  # as if killed before its last object
    with pytest.raises(InputError, match="holds no scenarios"):
        find(out)


def remove(one):
    system, path = one.file_system()
    system.rm_file(path)


class Failing(BaseHTTPRequestHandler):
    """Passes requests on to a server; every fifth gets 503 instead, every seventh nothing."""

    protocol_version, to, requests = (
        "HTTP/1.1",
        "",
        count(1),
    )  # 1.1: who sends a body waits for 100 Continue

    def log_message(self, *_):
        """Be silent."""

    def _pass(self):
        number, body = (
            next(self.requests),
            self.rfile.read(int(self.headers.get("Content-Length", 0))),
        )
        if number % 7 == 0:
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
        elif number % 5 == 0:
            self.send_error(503)
        else:
            there = HTTPConnection(self.to)
            there.request(self.command, self.path, body, dict(self.headers))
            answer = there.getresponse()
            self.send_response(answer.status)
            data = answer.read()
            for name, value in answer.getheaders():
                if name.lower() not in ("transfer-encoding", "connection", "content-length"):
                    self.send_header(name, value)
            self.send_header(
                "Content-Length",
                answer.getheader("Content-Length", "0") if self.command == "HEAD" else len(data),
            )
            self.send_header("Connection", "close")
            self.end_headers()
            self.wfile.write(data)

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = _pass  # noqa: N815


def test_a_store_that_fails_now_and_then_gives_the_same_bytes(bucket, server, corpus, monkeypatch):
    handler = type("To", (Failing,), {"to": server.removeprefix("http://")})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as proxy:
        thread = threading.Thread(target=proxy.serve_forever)
        thread.start()
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{proxy.server_address[1]}")
        fsspec.get_filesystem_class("s3").clear_instance_cache()
        out = place(f"{bucket}/failing")
        made = mine([place(f"{bucket}/spmd")], out)
        assert not made.failed and tables(out) == tables(corpus[0])
        proxy.shutdown()
        thread.join()


@pytest.mark.long
@pytest.mark.parametrize("seconds", [1.5, 2.5, 3.5])
def test_a_killed_run_is_gone_on_with(bucket, corpus, seconds):
    words = [
        sys.executable,
        "-m",
        "scenario_gen",
        "mine",
        f"{bucket}/spmd",
        "--out",
        f"{bucket}/killed",
        "--workers",
        "1",
    ]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        time.sleep(seconds)
        process.kill()
    subprocess.run(words, capture_output=True, check=True)
    assert tables(place(f"{bucket}/killed")) == tables(corpus[0])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("mine", "BUCKET/nothing", "--out", "BUCKET/out"), "s3://.*/nothing does not exist"),
        (
            ("mine", "s3://no-such-bucket/a", "--out", "BUCKET/out"),
            "s3://no-such-bucket/a does not exist; check bucket and name",
        ),
        (("mine", "BUCKET/spmd", "--out", "https://example.org/x"), "https is read-only"),
        (("mine", "ftp://host/a", "--out", "BUCKET/out"), "ftp is not supported"),
        (("batch", "BUCKET/out", "--roads", "straight", "--out", "x"), "out holds no encounters/"),
        (("find", "BUCKET/out"), "out holds no scenarios"),
        (
            ("roads", "BUCKET/a.xodr", "--out", "x.svg"),
            "a.xodr: a map takes a file or folder; copy it first",
        ),
    ],
)
def test_what_cannot_be_is_said_with_its_url(bucket, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [word.replace("BUCKET", bucket) for word in words])
    assert isinstance(done.exception, InputError) and re.search(said, str(done.exception)), (
        done.output
    )


def test_without_credentials_the_url_and_the_remedy_are_named(bucket, monkeypatch, tmp_path):
    nobody = {
        "AWS_ACCESS_KEY_ID": "",
        "AWS_SECRET_ACCESS_KEY": "",
        "AWS_EC2_METADATA_DISABLED": "true",
        "HOME": str(tmp_path),
    }
    for name, value in nobody.items():
        monkeypatch.setenv(name, value)
    fsspec.get_filesystem_class("s3").clear_instance_cache()
    with pytest.raises(InputError, match=f"{bucket}/spmd.*credentials"):
        mine([place(f"{bucket}/spmd")], tmp_path / "out")
