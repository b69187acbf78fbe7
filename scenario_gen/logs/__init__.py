"""Raw files and bags -> encounters (paper II-A)."""
