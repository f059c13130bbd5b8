"""Reproduction of the paper's evaluation: assumptions, claims, runs, verdicts and figures."""
