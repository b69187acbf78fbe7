# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a user of the segmentation alone does; run as a script, it says in JSON what it got."""

import json
import sys
from time import perf_counter

before = set(sys.modules)
started = perf_counter()
from scenario_gen.method.segmentation import StickyHDPHMM  # noqa: E402 - timed

seconds = perf_counter() - started

import numpy as np  # noqa: E402

labels = np.repeat([0, 1, 0], 80)
x = np.random.default_rng(0).normal(size=(240, 2)) + 5.0 * labels[:, None]
model = StickyHDPHMM(random_state=1).fit(x)
files = (
    name for name in set(sys.modules) - before if getattr(sys.modules[name], "__file__", None)
)
own = {name.partition(".")[0] for name in files}
loaded = sorted(
    name for name in own - set(sys.stdlib_module_names) if not name.startswith(("_", "cython"))
)
json.dump({"states": model.n_states_, "seconds": seconds, "loaded": loaded}, sys.stdout)
