# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled log: made up, believable, the same bytes every time, and read back to its ground truth."""

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from support.synthetic_cases import main, make_case, ORIGIN, START_NS

from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.synthetic import bundled, CASES
from scenario_gen.situation import find_waits


@pytest.fixture(params=CASES)
def case(request):
    return make_case(request.param)


def test_the_bundled_files_are_what_the_module_writes(tmp_path, capsys):
    main(tmp_path)
    assert capsys.readouterr().out.count("synthetic_") == 3
    for name in CASES:
        made, kept = tmp_path / f"synthetic_{name}", bundled(name)
        files = sorted(file.name for file in made.iterdir())
        assert (
            files
            == sorted(file.name for file in kept.iterdir())
            == ["metadata.yaml", f"synthetic_{name}.mcap"]
        )
        for file in files:
            assert (made / file).read_bytes() == (kept / file).read_bytes()
            assert (kept / file).stat().st_size < 300_000
        assert "synthetic" in (kept / "metadata.yaml").read_text()


def test_the_paper_s_story():
    a, b, c = (make_case(name) for name in CASES)
    assert a.changepoints == pytest.approx((7.0, 10.0))
    stands = a.drives[0].state(np.array([0.0, 9.0, 18.0]))
    assert (stands[:, 3] == 0.0).all() and np.ptp(stands[:, :2], axis=0).max() < 1e-9
    other = a.drives[1].state(np.array([0.0, 7.0, 10.0, 18.0]))
    assert other[0, 3] == 11.0 and (np.abs(other[1:3, 3]) < 1e-9).all()
    assert np.degrees(other[3, 2] - other[0, 2]) == pytest.approx(-90.0)  # a right turn
    passes, turns = (drive.state(np.array([0.0, 15.0])) for drive in b.drives)
    assert passes[1, 3] > passes[0, 3]
    assert np.degrees(turns[1, 2] - turns[0, 2]) == pytest.approx(90.0)  # a left turn
    assert np.cos(passes[0, 2] - turns[0, 2]) == pytest.approx(-1.0)  # from the opposite direction
    assert c.changepoints == pytest.approx((4.0, 8.0, 12.0))


def test_all_readers_decode_every_message(case):
    bag = bundled(case.name[-1])
    with AnyReader([bag]) as reader:
        counts = sum(
            1
            for connection, _, data in reader.messages()
            if reader.deserialize(data, connection.msgtype)
        )
    with (bag / f"{case.name}.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        decoded = list(reader.iter_decoded_messages())
    assert len(decoded) == counts > 500
    stamps = [message.log_time for _, _, message, _ in decoded]
    assert stamps == sorted(stamps)
    assert "version: 9" in (bag / "metadata.yaml").read_text()
    assert (bag / "metadata.yaml").read_text().count("RIHS01_") == 4


def test_reading_recovers_the_truth(case):
    result = read_log(bundled(case.name[-1]), LogConfig(origin=f"{ORIGIN[0]},{ORIGIN[1]}"))
    (encounter,) = result.encounters
    assert encounter.name == case.name
    assert encounter.duration > case.duration - 0.35
    time = (encounter.start_ns - START_NS) * 1e-9 + encounter.time
    for n, drive in enumerate(case.drives):
        truth = drive.state(time)
        error = np.hypot(*(encounter.position[n] - truth[:, :2]).T)
        assert error.max() < 1.0  # GPS noise of 0.3 m per axis that lasts for 20 s
        assert np.sqrt(((encounter.speed[n] - truth[:, 3]) ** 2).mean()) < 0.12
        assert np.abs(encounter.speed[n] - truth[:, 3]).max() < 0.45
        off = np.angle(np.exp(1j * (encounter.heading[n] - truth[:, 2])))
        assert np.abs(off).max() < 0.16
    assert not result.quality.encounters[0].overlaps
    reasons = {drop.reason for drop in result.quality.dropped}
    assert reasons == {"stamp repeated"}
    assert all(vehicle.bridged > 3 for vehicle in result.quality.vehicles)
    if case.name == "synthetic_a":
        waits = find_waits(encounter)
        assert [wait.vehicle for wait in waits] == [0, 1]
        assert waits[1].start == pytest.approx(7.0, abs=0.6)
        assert waits[1].end == pytest.approx(10.0, abs=0.8)
