"""Time: hosts that compute, links that carry, ROS graphs that connect them, and the world that is
built of all three.

The only package that knows SimPy. It is built from plain values (``setup``) and tells a ``Monitor``
what happens; it imports ``core`` and nothing above. The runner, the methods and the faults call it.
"""
