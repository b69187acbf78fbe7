# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line and what is already there: `--out` replaces earlier results only; names stay names; signals end it cleanly."""

import errno
from functools import partial
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

import pytest
from support.source_files import content

from scenario_gen.base.folders import PREFIX
from scenario_gen.logs.synthetic import bundled

GENERATE = (
    "generate",
    bundled("c"),
    "--road",
    "straight",
    "--count",
    2,
    "--set",
    "evaluation.resamples=20",
)


def test_lookalikes_are_no_earlier_result(run, made, tmp_path):
    """The two that once were lost: a recording, for a scenario of its own, and notes beside a page called report.html."""
    bag = tmp_path / "generated_bag"
    shutil.copytree(made / "bag", bag)
    before = content(bag)
    code, said = run("export", made / "bag", "--to", "commonroad", "--out", bag)
    assert code == 2 and "is not an earlier result" in said and content(bag) == before
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "report.html").write_text("a report of mine")
    code, said = run(*GENERATE, "--out", "page")
    assert (
        code == 2
        and "report.html" in said
        and (tmp_path / "page" / "report.html").read_text() == "a report of mine"
    )


NAME = "[red]a\x1b[31m\n*b*\u202e[/]"


def test_names_are_shown_letter_by_letter(run, tmp_path):
    rows = ["t_s,vehicle_id,x_m,y_m,speed_mps"]
    rows += [
        f"{k / 10},{who},{start + 0.8 * k},0,8"
        for who, start in (("[bold]lead[/]", 20), ("ta\x1bil", 0))
        for k in range(120)
    ]
    log = tmp_path / f"{NAME.replace('[/]', '')}.csv"
    log.write_text("\n".join(rows) + "\n")
    literal = r"[red]a\x1b[31m\n*b*\u202e"
    out = f"[out]{NAME.replace('/', '')}"
    code, said = run("generate", log, "--road", "straight", "--count", 2, "--out", out)
    assert (
        code == 0
        and f"{literal} on straight" in said
        and rf"report: [out]{literal}[]/report.html" in said
    ), said
    bag = (tmp_path / out / "bag").rename(tmp_path / NAME.replace("[/]", ""))
    more = (
        ("evaluate", bag, "--out", "figures"),
        ("evaluate", bag),
        ("evaluate", log),
        ("generate", NAME, "--road", "straight"),
    )
    told = [run(*words)[1] for words in more]
    escaped = r"\[red\]a\\x1b\[31m\\n\*b\*\\u202e"  # in Markdown, which a pipe receives
    assert f"{escaped} on straight" in told[0]
    assert all("\x1b" not in text and "\u202e" not in text for text in (said, *told))


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EIO, os.strerror(errno.EIO), "some/file"), "some/file: Input/output error"),
        (
            PermissionError(errno.EACCES, os.strerror(errno.EACCES), "secret"),
            "secret: Permission denied",
        ),
        (MemoryError(), "not enough memory"),
        (OSError("no number, no name"), "no number, no name"),
    ],
)
def test_system_errors_are_one_message(run, monkeypatch, error, words):
    def broken(*_):
        raise error

    monkeypatch.setattr("scenario_gen.cli.folder.read_log", broken)
    code, said = run(*GENERATE, "--out", "out")
    assert code == 2 and words in said and "Traceback" not in said
    assert list(Path().iterdir()) == []


def started(tmp_path, *words, **options):
    command = [sys.executable, "-m", "scenario_gen", *map(str, words)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    hears_ctrl_c = partial(
        signal.signal, signal.SIGINT, signal.SIG_DFL
    )  # which a shell may have it ignore
    return subprocess.Popen(command, cwd=tmp_path, preexec_fn=hears_ctrl_c, **pipes, **options)  # noqa: PLW1509 - one thread


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_signal_ends_it_and_leaves_nothing(made, tmp_path, number):
    shutil.copytree(made, tmp_path / "out")
    before = content(tmp_path)
    process = started(tmp_path, *GENERATE[:5], 10_000, "--out", "out")
    end = time.monotonic() + 300.0
    while (
        process.poll() is None and not any(tmp_path.glob(f"{PREFIX}*")) and time.monotonic() < end
    ):
        time.sleep(0.01)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == -number
    assert said.strip() == f"stopped by {number.name}"
    assert content(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.skipif(
    not Path("/proc/self/maps").exists(), reason="no /proc to see what a process has loaded"
)
def test_a_signal_while_the_libraries_load(tmp_path):
    process = started(tmp_path, "--parameters")
    while process.poll() is None and "numpy" not in Path(f"/proc/{process.pid}/maps").read_text():
        time.sleep(0.001)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == -signal.SIGINT and said.strip() == "stopped by SIGINT"


def test_full_and_closed_output_are_handled(tmp_path):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "scenario_gen", "--parameters"]
        ended = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (
        ended.returncode == 2
        and "No space left on device" in ended.stderr
        and "Traceback" not in ended.stderr
    )
    process = started(tmp_path, "--parameters")
    process.stdout.close()  # it writes later: it has libraries to load
    assert "Traceback" not in process.stderr.read()
    process.wait()
    process.stderr.close()
    assert process.returncode == 0
