"""The one error that a user's mistake becomes: a line that says what, where and how to mend it."""


class InputError(ValueError):
    """Something the user gave cannot be used; the message is one line fit to be shown as it is.

    The command line prints the message without a traceback and exits with status 2.
    """
