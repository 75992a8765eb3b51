"""Errors whose message is a single line for the user."""


class InputError(ValueError):
    """The user's input is unusable.

    The message is one line: what, where, and how to fix it. The command line prints it without a traceback and exits
    with status 2.
    """


class SimulationError(RuntimeError):
    """A simulation or a training run failed, although the input is valid.

    The message is one line. The command line prints it without a traceback and exits with status 1.
    """
