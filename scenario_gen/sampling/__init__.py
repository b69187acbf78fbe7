"""Time law and Gaussian process -> candidate scenarios (paper III-C)."""
