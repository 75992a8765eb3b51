"""The command line: arguments in, library calls, one clear line on an error; a file a verb or two."""

from surfsup.cli.program import main

__all__ = ["main"]
