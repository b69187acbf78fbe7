"""Encounter -> primitives and changepoints, with their posterior (paper II-B)."""
