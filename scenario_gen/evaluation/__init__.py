"""DTW features (paper V-B), realism, criticality and the report."""
