# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags: bytes (storage), generations (recordings), and vehicles of other programs."""
