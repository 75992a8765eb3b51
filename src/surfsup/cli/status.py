"""The exit statuses of the program beyond 0 for done."""

FAULT = 1
BAD_INPUT = 2
INTERRUPTED = 130
