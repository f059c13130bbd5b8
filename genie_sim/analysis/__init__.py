"""Arithmetic on the tables of a run: an object a metric, one table of results, figures. It knows
nothing of the simulator.
"""
