"""The same Genie in real ROS 1 and ROS 2: attaching it to a running node, links between Genies,
bags.

An adapter around ``core``; it needs the extra ``ros``. Only the command line calls it.
"""
