# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pages and their assets."""

from scenario_gen.base.errors import needs

needs("report", "jinja2")
