"""Strangers' files and frames: KITTI, detectors, placement, traces, importers, and the interface of
a source of frames. Heavy libraries are imported late.
"""
