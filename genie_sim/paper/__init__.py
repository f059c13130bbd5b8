"""The paper's evaluation: readings, runs, claims with their verdicts, figures."""
