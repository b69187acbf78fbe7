# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All nodes, their kernels and messages, loaded once: multiprocessing's server imports this, and each node's process is forked from it."""

from contextlib import suppress

from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import SetParameters
from rclpy.type_support import check_for_type_support
from std_srvs.srv import Trigger

from msg_conventions.topics import TOPICS
from scenario_gen.base.errors import InputError
from scenario_gen.numerics.kernels import registered
from scenario_gen.ros.common.process import kernels_ready
from scenario_gen.ros.common.start import node_class
from scenario_gen.ros.common.topics import message_class
from scenario_gen.ros.node_names import ALL

kernels_ready(
    dict.fromkeys(stage for node in ALL for stage in getattr(node_class(node), "STAGES", ()))
)
for kernel in registered(on_demand=False):
    kernel.compile()
for service in (GetState, SetParameters, Trigger):
    check_for_type_support(service)
for kind in {kind for kind, _ in TOPICS.values()}:
    with suppress(InputError):  # a package that is not installed
        check_for_type_support(message_class(kind))
