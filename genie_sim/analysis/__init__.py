"""Arithmetic on the tables of a run: a class a metric, one table of results, figures. It knows
nothing of the simulator.
"""
