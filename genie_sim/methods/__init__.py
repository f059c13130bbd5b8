"""Methods: what a scenario compares, one file each. ``sim.method`` says what one is, and names
them. They may import ``base``, ``core`` and ``sim``.
"""
