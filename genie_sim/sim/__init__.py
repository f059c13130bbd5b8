"""Time: hosts that compute, links that carry, ROS graphs that connect them, and the world that is
built of all three, as SimPy processes. It may import ``base``, ``core`` and ``tracks``.
"""
