"""Messages <-> domain types: pure functions, one place."""
