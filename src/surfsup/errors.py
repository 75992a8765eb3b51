"""What goes wrong, as one line: a user's mistake, or a computation that failed."""


class InputError(ValueError):
    """Something the user gave cannot be used; the message is one line fit to be shown as it is.

    The command line prints the message without a traceback and exits with status 2.
    """


class SimulationError(RuntimeError):
    """A simulation or a training run could not go on, through no mistake of the user's; the message is one line.

    The command line prints the message without a traceback and exits with status 1.
    """
