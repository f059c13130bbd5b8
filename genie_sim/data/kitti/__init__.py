"""KITTI: from its files to traces and their truth.

A drive has a ``drive_name``. ``drive`` opens raw drives and sequences of the odometry benchmark,
whose files are where ``layouts`` says; ``pipeline`` takes their frames through a detector,
``perceive`` makes the trace, and ``trace_check`` makes it again and compares. What was there is
told by labels, each in one picture a ``label``: ``tracklets`` reads those of raw drives,
``tracking_labels`` those of the tracking benchmark, whose ``tracking_sequence`` says where its
camera was; ``drive_truth`` makes a truth table of either. ``oxts`` and ``number_files`` read
numbers.
"""
