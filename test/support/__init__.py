# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Helpers for tests of several folders: scenes, files, fixtures, processes."""
