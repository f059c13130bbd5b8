"""The paper's evaluation: readings, runs, claims with their verdicts, figures. It simulates through
``api`` alone, and may import ``base``, ``core``, ``sim`` (what its observer sees), ``scenario``,
``record``, ``analysis`` and ``report``.
"""
