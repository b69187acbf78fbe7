# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a recording lacks, by the numbers of the messages."""

import pytest

from msg_conventions.topics import topic_entry
from scenario_gen.bags.recordings.message_loss import BEGAN_LATE, MessageLoss


@pytest.mark.parametrize(
    "topic",
    ["/tf", "/clock", "/vehicle_1/odom", "/vehicle_1/fix", "/verdicts", "/ego/witness", "/map"],
)
def test_earlier_messages_are_no_loss(topic):
    losses, quality = MessageLoss(lambda _: 1), topic_entry(topic)[1]
    losses.begin(topic, quality)
    for number in (5358, 5359, 5362):
        losses.add(topic, b"", number)
    said = str(losses.summary().get(topic, ""))
    assert (BEGAN_LATE in said) == (topic in ("/verdicts", "/ego/witness"))
    assert said.startswith("2 lost") == (topic != "/map"), (
        "a map that was overwritten is not missed"
    )
