"""What people look at: the page of a run, a comparison, an evaluation or a sweep, and a notebook's
tables. It may import ``base``, ``core``, ``data``, ``record`` and ``analysis``.
"""
