# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags: their bytes (storage), generations in them (recordings), and vehicles in the messages of others."""
