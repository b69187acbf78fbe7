"""Turn a handful of recorded vehicle encounters into any number of new, valid ones on other roads."""

__version__ = "0.1.0"
