"""The design tasks of section 7 of the SURFSUP supplement, a file each."""
