"""Detectors of objects in pictures, and where the objects in their boxes are."""
