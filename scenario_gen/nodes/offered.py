# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a topic's publishers offer decides how the recorder subscribes, and what it writes into the bag for the player."""

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from msg_conventions.topics import Quality, topic_entry

DEPTH = 1000


def offered(topic: str, profiles: Sequence[QoSProfile]) -> tuple[Quality, Quality]:
    """Return the quality to subscribe with, which suits every publisher, and the one to offer at replay.

    Of the suite's own topics all is kept (DDS holds 5000 messages), so that publishers that pace themselves wait for the
    recorder; other messages may be of any size, and the newest are kept.

    Discovery does not always tell a publisher's depth; then it is that of the topic's kind.
    """
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    transient_local = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
    told = max(profile.depth for profile in profiles)
    depth = told or (DEPTH if topic.endswith(("/scenarios", "/scenarios/info")) else 1)
    return Quality(max(DEPTH, told), reliable, transient_local, keep_all=reliable and _of_a_suite(topic)), Quality(
        depth, reliable, transient_local
    )


def _of_a_suite(topic: str) -> bool:
    try:
        topic_entry(topic)
    except KeyError:
        return False
    return True
