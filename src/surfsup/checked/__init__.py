"""Files from strangers: what is read from them is plain numbers, in the file itself, and finite."""
