"""Maps that track: looks go in, each once, and objects come out where they are predicted, each with
how likely it still exists.
"""
