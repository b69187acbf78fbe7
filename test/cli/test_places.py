# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Commands on URLs: the same files as on paths; nothing in a store is replaced; nothing stays on this machine."""

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
import json
from pathlib import Path
import threading

import boto3
import pytest
from support.object_store import new_bucket, reached, read, serving

from scenario_gen.base.stores import place, relative_name, upload
from scenario_gen.logs.synthetic import bundled

pytestmark = pytest.mark.xdist_group("places")
GENERATE = ("--road", "straight", "--count", "2", "--set", "evaluation.resamples=20")


@pytest.fixture(scope="module")
def server():
    with serving() as address:
        yield address


@pytest.fixture
def bucket(server, monkeypatch, request, tmp_path):
    """A bucket with a log, whose URL this is; copies of objects come to lie in tmp_path/copies."""
    reached(monkeypatch, server)
    (tmp_path / "copies").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "copies"))
    url = new_bucket(f"b{abs(hash(request.node.name))}")
    upload(bundled("c"), place(f"{url}/logs/synthetic_c"))
    return url


def objects(url):
    return {relative_name(one, place(url)): read(one) for one in place(url).rglob("*")}


def test_what_is_written_to_a_store_is_what_is_written_to_a_folder_and_is_read_there(
    bucket, run, tmp_path
):
    assert run("generate", bundled("c"), *GENERATE, "--out", "made")[0] == 0
    code, text = run(
        "generate", f"{bucket}/logs/synthetic_c", *GENERATE, "--out", f"{bucket}/made"
    )
    assert code == 0 and f"report: {bucket}/made/report.html" in text and "copies" not in text
    files = {
        path.relative_to(tmp_path / "made").as_posix(): path
        for path in (tmp_path / "made").rglob("*")
        if path.is_file()
    }
    stored, differ = (
        objects(f"{bucket}/made"),
        {"report.html", ".scenario_gen.json"},
    )  # which say from where the log is
    assert {name: stored[name] for name in stored.keys() - differ} == {
        n: files[n].read_bytes() for n in files.keys() - differ
    }
    assert (
        stored["report.html"].decode().replace(f"{bucket}/logs/synthetic_c", str(bundled("c")))
        == files["report.html"].read_text()
    )
    assert "2 of 2 scenarios are valid" in run("validate", f"{bucket}/made/bag")[1]
    code, text = run("evaluate", f"{bucket}/made/bag", "--out", f"{bucket}/figures", "--json")
    assert (
        code == 0
        and json.loads(text[text.index("{") :].splitlines()[0])["folder"] == f"{bucket}/figures"
    ), text
    assert {"evaluation.json", "report.html"} < set(objects(f"{bucket}/figures"))
    code, text = run("report", f"{bucket}/made/bag")
    assert code == 2 and f"--out is missing: give a folder or a URL, as the input {bucket}" in text
    assert (
        run("report", f"{bucket}/made/bag", "--out", "page")[0] == 0
        and (tmp_path / "page" / "report.html").exists()
    )
    assert run("report", f"{bucket}/made") == (0, f"report: {bucket}/made/report.html\n")
    assert not list((tmp_path / "copies").iterdir())


def test_nothing_in_a_store_is_replaced_and_what_fails_writes_nothing(bucket, run, tmp_path):
    before = objects(bucket)
    code, text = run(
        "generate", f"{bucket}/logs/synthetic_c", *GENERATE, "--out", f"{bucket}/logs"
    )
    assert code == 2 and f"{bucket}/logs exists, and objects are never overwritten" in text
    code, text = run("generate", f"{bucket}/none.csv", *GENERATE, "--out", f"{bucket}/made")
    assert code == 2 and f"{bucket}/none.csv does not exist" in text
    code, text = run(
        "generate", f"{bucket}/logs/synthetic_c", "--road", "no_road", "--out", f"{bucket}/made"
    )
    assert code == 2 and "no_road" in text
    code, text = run(
        "generate", f"{bucket}/logs/synthetic_c", *GENERATE, "--out", "https://127.0.0.1/made"
    )
    assert code == 2 and "https is read-only" in text
    assert objects(bucket) == before and not list((tmp_path / "copies").iterdir())


def test_an_error_in_an_object_names_its_url(bucket, run, tmp_path):
    client, name = boto3.client("s3"), bucket.removeprefix("s3://")
    client.put_object(Bucket=name, Key="logs/bad.csv", Body=b"vehicle,time,x,y\n1,0,0,abc\n")
    code, text = run("generate", f"{bucket}/logs/bad.csv", *GENERATE, "--out", "made")
    assert code == 2 and f"{bucket}/logs/bad.csv" in text and "copies" not in text


LOG = Path(__file__).parents[2] / "examples" / "my_log.csv"
AUTO = ("--road", "auto", *GENERATE[2:])


def test_a_log_is_read_from_the_web_and_a_file_url_is_a_path(run, tmp_path):
    handler = type("Silent", (SimpleHTTPRequestHandler,), {"log_message": lambda *_: None})
    with ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(handler, directory=str(LOG.parent))
    ) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        url = f"http://127.0.0.1:{server.server_address[1]}/{LOG.name}"
        first = run("generate", url, *AUTO, "--out", "web")
        server.shutdown()
        thread.join()
    assert first[0] == 0, first[1]
    assert run("reindex", f"file://{tmp_path}/web/bag", "--out", f"file://{tmp_path}/file")[0] == 0
    assert list((tmp_path / "file").glob("*.mcap"))
