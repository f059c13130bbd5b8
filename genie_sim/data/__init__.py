"""Strangers' files and frames: KITTI, detectors, placement, traces, importers, and the interface of
a source of frames. It may import ``base``, ``core`` and ``tracks``; heavy libraries are imported
late.
"""
