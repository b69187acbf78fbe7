# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag as drafts of 0.6.0 wrote it: my_log.csv on `four_way`, vehicle 1 left out; see former.py."""

from pathlib import Path

import numpy as np

from scenario_gen.bags.recordings.read import load, read_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.closed_loop.trials import read_trials
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.output.review.replan import replanned

BAG = Path(__file__).parent / "former"


def test_bag_of_earlier_formats_is_read():
    kinds = {message.topic: message.type for message in read_messages(BAG)}
    assert kinds["/road/lanes"].endswith("/Marker")
    assert kinds["/fit/info"].endswith("/DiagnosticArray")
    result = load(BAG)
    road, fit = result.road_and_fit()
    assert [vehicle.manoeuvre for vehicle in fit.fitted] == ["straight", "straight"]
    assert [vehicle.scale for vehicle in fit.fitted] == [1.0, 1.0]
    assert str(fit.notes[0]).startswith("vehicle 1 drives on lanes 2.-1,")
    assert fit.requested.start.shape == (2, 4) and not fit.losses
    assert [len(route.points) for route in result.routes] == [333, 214]
    assert result.routes[0].joined is not None and not np.isnan(result.routes[0].farthest)
    assert (len(road.entries), len(road.exits)) == (4, 4)
    lanes = road.lanes
    assert len(lanes.lanes) == 20 and lanes.drawn_for.lanes[0] == ("2.-1", "1.1")
    assert [rule.kind for rule in lanes.rules] == ["give_way"] and lanes.arms.keys() == {
        1,
        2,
        3,
        4,
    }
    assert lanes.lanes[0].left.shape == lanes.lanes[0].right.shape


def test_former_bag_is_evaluated_and_driven():
    (found,) = evaluate_bag(BAG)
    assert (found.valid, found.causes, found.notes) == (2, {}, ())
    assert [trial.road.lanes.drawn for trial in read_trials(BAG)] == [True, True]
    recorded = read_recording(BAG).namespaces[""]
    (info, entry), summary = recorded.infos[0], recorded.summaries[0]
    topics = [message.topic for message in recorded.messages_of(info, entry, summary)]
    assert {"/fit/info", "/road/lanes", "/tracks", "/changepoints", "/map"} <= set(topics)
    assert (entry.index, entry.seed, entry.road, entry.ego.id) == (2, 3, "four_way", "1")
    assert (entry.facts.pet_s, str(entry.facts.reactions[0])) == (4.388, "2 yields to 1")
    assert entry.asked(witness=True).start.shape == (2, 4) and entry.achieved.shape == (2, 1, 4)
    assert summary.message() == "2 of 2 scenarios from 8 candidates"
    assert summary.refused["late_braking"] == 4 and summary.provenance["log.format"] == "auto"
    planned = replanned(BAG).planned
    assert planned.fit is not None and planned.fit.fitted and len(planned.routes) == 2
