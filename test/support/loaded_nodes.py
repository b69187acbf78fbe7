# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All nodes and their kernels, loaded once: multiprocessing's server imports this, and each node's process is forked from it."""

from scenario_gen.ros.plumbing.process import kernels_ready
from scenario_gen.ros.plumbing.start import node_class, NODES

kernels_ready(
    dict.fromkeys(
        stage for node in (*NODES, "traffic") for stage in getattr(node_class(node), "STAGES", ())
    )
)
