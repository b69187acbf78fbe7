"""Occupancy grids, their entries and exits, and the readers of map formats."""
