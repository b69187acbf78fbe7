"""Benchmarks of each stage beside the best installable peer, measured in the same run, in CPU time, as ratios."""
