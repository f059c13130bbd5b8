"""What a node does with messages, as pure classes: Genie (Algorithms 1 and 2), its caches, keys,
policies and rules.

Standard library and numpy only: no clock, no thread, no SimPy, no ROS. ``sim`` and ``ros`` are
adapters around it.
"""
