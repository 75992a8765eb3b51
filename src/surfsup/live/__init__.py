"""Water in real time in a browser, and the commands that change it: ``surfsup live``."""
