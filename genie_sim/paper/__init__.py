"""The paper's evaluation: what it leaves open, its claims and their tests, the runs behind them,
verdicts, figures.
"""
