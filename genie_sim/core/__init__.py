"""What a node does with messages, as pure classes: Genie (Algorithms 1 and 2), its caches, keys,
policies and rules. It needs the standard library and numpy alone: no clock, no ROS.

Here as in all rooms a method whose name is in the past tense is told what has happened (``stored``,
``answered``), and one whose name asks changes nothing.
"""
