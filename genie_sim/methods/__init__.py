"""Methods: what a scenario compares, one file each. ``sim.method`` says what one is, and names
them.
"""
