"""The command line: it parses arguments, calls the library and prints errors as one line. One file per verb or two."""

from surfsup.cli.program import main

__all__ = ["main"]
