"""The exit statuses of the program other than 0."""

FAULT = 1
BAD_INPUT = 2
INTERRUPTED = 130
