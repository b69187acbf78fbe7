# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lock-step over DDS: how many times faster than real time a planner drives."""

from collections.abc import Callable
import os
from pathlib import Path
import tempfile
import time
from typing import Any, TypeVar

from benchmarks._suite_processes import environment, nodes
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.base.ros_domain import free_domain
from scenario_gen.types.generation import GenerationResult

Result = TypeVar("Result")


def lock_step(made: GenerationResult, steps: int) -> tuple[float, float]:
    """Return seconds of the drive per second of real time, after 20 steps to warm up; and CPU time of a step [ms], of both sides.

    A step is one command and one call of traffic/step, one after the other: on an idle machine it lasts hardly longer than that.
    """
    with tempfile.TemporaryDirectory() as name, free_domain() as domain:
        bag = write_recording(Path(name) / "bag", made)
        os.environ.update(environment(domain))
        parameters = ["-p", f"bag:={bag}", "-p", "lock_step:=true", "-p", "drive.overtime:=10.0"]
        with nodes(Path(name), domain, {"traffic": parameters}) as suite:
            return _calls(domain, steps, suite.pids[0])


def _cpu(pid: int) -> float:
    """Return the CPU seconds of another process so far (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _calls(domain: int, steps: int, pid: int) -> tuple[float, float]:
    from std_srvs.srv import Trigger

    from msg_conventions.driving import encode_twist
    from scenario_gen.ros.common.topics import create_publisher

    def work(node: Any, spin: Callable[[Any], None]) -> tuple[float, float]:
        publisher, client = (
            create_publisher(node, "ego/cmd_vel"),
            node.create_client(Trigger, "/traffic/step"),
        )
        client.wait_for_service(60.0)
        while publisher.get_subscription_count() < 1:
            time.sleep(0.05)
        began, used, done = 0.0, 0.0, 0
        for k in range(steps + 20):
            if k == 20:
                began, used = time.perf_counter(), _cpu(pid) + time.process_time()
            publisher.publish(encode_twist(0.2, 0.0))
            answer = client.call_async(Trigger.Request())
            spin(answer)
            done += k >= 20 and answer.result().success
        spent = _cpu(pid) + time.process_time() - used
        return 0.1 * done / (time.perf_counter() - began), 1e3 * spent / steps

    return _with_node(domain, work)


def _with_node(domain: int, work: Callable[[Any, Callable[[Any], None]], Result]) -> Result:
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("drive_benchmark", context=context, start_parameter_services=False)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin(future: Any) -> None:
        """Until the future is done; rclpy 7.1's spin_until_future_complete leaves a task for each time that it looked."""
        while not future.done():
            executor.spin_once()

    try:
        return work(node, spin)
    finally:
        node.destroy_node()
        context.try_shutdown()
