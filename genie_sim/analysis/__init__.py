"""Arithmetic on the tables of a run: a class a metric, one table of results, figures. It may import
``base``, ``core`` and ``record``, never the simulator.
"""
