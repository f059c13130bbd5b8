"""Writes the pages of the reference, which are made from the program itself."""
