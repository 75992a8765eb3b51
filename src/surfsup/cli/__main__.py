"""The command line as ``python -m surfsup.cli``."""

from surfsup.cli import main

main()
