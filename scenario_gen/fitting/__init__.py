"""Changepoints -> the target road (paper III-A, eqs 7-9 put right)."""
