"""Arithmetic on the tables of a run: metrics, statistics, the summary and the figures.

It reads tables and never the simulator; the report, the evaluation of the paper and sweeps call it.
"""
