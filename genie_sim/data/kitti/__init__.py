"""KITTI: raw drives, odometry and tracking sequences with their labels; drives through a detector,
and how good what it finds is.
"""
