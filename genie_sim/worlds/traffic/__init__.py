"""Recorded traffic, such as SUMO's, as a source of frames.

It is a world and no drive's frames (``data.importers.trace_import``): its file has no detections,
and what a car sees is computed at the car's own times.
"""
