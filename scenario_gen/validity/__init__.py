"""The independent checker: proves a scenario valid in space and time, or says what is wrong."""
