# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is about the recorded encounter on its own ground: tracks, path coordinates, stops, conflicts."""
