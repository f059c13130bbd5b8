"""Recorded traffic, such as SUMO's, as a source of frames."""
