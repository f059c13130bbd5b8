"""Many runs: seeds and sweeps, resumed, on several processes, judged into tidy tables. It
may import every room below it: all but ``paper``, ``ros``, ``cli`` and ``api``.
"""
