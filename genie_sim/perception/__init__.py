"""From camera frames to detections in the world: KITTI, detectors, placement, traces, and where
frames come from.

Heavy libraries are imported where they are used; replaying a trace needs none of them.
"""
