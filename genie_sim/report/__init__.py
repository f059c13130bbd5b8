"""What people look at: the page of a run, a comparison, an evaluation or a sweep, and a notebook's
tables.
"""
