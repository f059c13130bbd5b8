"""The same Genie in real ROS 1 and ROS 2: attached to a running node, links between Genies, bags.
It may import ``base``, ``core``, ``data``, ``scenario``, ``record``; it needs the extra ``ros``.
"""
