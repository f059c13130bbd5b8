"""Faults: what goes wrong in a run, one file each. ``sim.fault`` says what one is, and names
them.
"""
