"""What a node does with messages, as pure classes: Genie (Algorithms 1 and 2), its caches, keys,
policies and rules. It may import ``base``, the standard library and numpy: no clock, no ROS.
"""
