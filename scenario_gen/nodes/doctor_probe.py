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

"""The doctor's probes, each a process of its own: `speak TOPIC`, `listen TOPIC`, `kernels`. The answer is a line of JSON."""

from collections.abc import Iterator
import json
import sys
import time
from typing import Any

import scenario_gen.nodes  # noqa: F401  (what the wheels need)

WANTED = 5  # messages
LOOK = 1.5  # seconds in which other participants' topics come up


def speak(topic: str) -> None:
    """Publish until killed."""
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("doctor_speaker", enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(String, topic, 10)
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        publisher.publish(String(data="hear me"))
        time.sleep(0.05)


def listen(topic: str) -> None:
    """Count what arrives, look around, and say so."""
    import rclpy
    from rclpy.utilities import get_rmw_implementation_identifier
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("doctor_listener", enable_rosout=False, start_parameter_services=False)
    heard: list[float] = []
    node.create_subscription(String, topic, lambda _: heard.append(time.monotonic()), 10)
    begin = time.monotonic()
    while len(heard) < WANTED and time.monotonic() - begin < 12.0:
        rclpy.spin_once(node, timeout_sec=0.1)
    time.sleep(max(0.0, begin + LOOK - time.monotonic()))
    topics = node.get_topic_names_and_types()
    answer = {
        "rmw": get_rmw_implementation_identifier(),
        "received": len(heard),
        "seconds": heard[0] - begin if heard else 0.0,
        "topics": len(topics),
        "faults": sorted(set(faults(node, topics))),
    }
    print(json.dumps(answer), flush=True)
    node.destroy_node()
    rclpy.shutdown()


def faults(node: Any, topics: list[tuple[str, list[str]]]) -> Iterator[str]:
    """Yield a sentence for every publisher and subscription that do not suit each other."""
    from rclpy.qos import qos_check_compatible, QoSCompatibility

    for topic, kinds in topics:
        if len(kinds) > 1:
            yield f"{topic} has several types: {', '.join(kinds)}"
        for publisher in node.get_publishers_info_by_topic(topic):
            for subscription in node.get_subscriptions_info_by_topic(topic):
                level, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
                if level == QoSCompatibility.ERROR:
                    ends = (f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in (publisher, subscription))
                    yield f"{topic}: {' → '.join(ends)} cannot connect: {reason}"


def kernels(_topic: str) -> None:
    """Count the kernels that are not in the cache; none is compiled."""
    from scenario_gen import compiling
    from scenario_gen import kernels as all_kernels

    all_kernels.import_all()
    needed = all_kernels.registered()
    print(json.dumps({"kernels": len(needed), "missing": len(compiling.missing(needed))}), flush=True)


if __name__ == "__main__":
    {"speak": speak, "listen": listen, "kernels": kernels}[sys.argv[1]](sys.argv[2] if len(sys.argv) > 2 else "")
