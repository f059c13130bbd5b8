"""From a scenario to its results: prepares the drives, simulates each method, writes the folder. It
may import everything but ``study``, ``paper``, ``ros``, ``cli`` and ``api``.
"""
