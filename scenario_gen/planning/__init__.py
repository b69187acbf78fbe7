"""RRT*-Connect on the grid, and other planners behind the same Protocol (paper III-B, Algorithms 1-5)."""
