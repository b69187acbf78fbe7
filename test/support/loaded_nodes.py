# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All nodes and their kernels, loaded once: multiprocessing's server imports this, and each node's process is forked from it."""

from scenario_gen.ros.common.process import kernels_ready
from scenario_gen.ros.common.start import node_class
from scenario_gen.ros.node_names import ALL

kernels_ready(
    dict.fromkeys(stage for node in ALL for stage in getattr(node_class(node), "STAGES", ()))
)
