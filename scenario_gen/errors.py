"""The errors that a person sees; each message names the place (file, row, topic, parameter) and what to do."""


class ScenarioGenError(Exception):
    """Base of every error this project raises on purpose; the command line prints it without a traceback and exits with 2."""

    exit_code = 2


class InputError(ScenarioGenError):
    """A file, row, topic or parameter cannot be used as it is."""


class RefusedError(ScenarioGenError):
    """The input is sound but what was asked cannot be done with it, e.g. a template that fits no road."""
