"""Recorded traffic, such as SUMO's, as a source of frames.

``fcd`` reads a file into rows, ``fcd_checks`` says whether they can be, ``vehicle_types`` what its
vehicles are, ``vehicles`` tells where each vehicle is at any time, ``view`` which of them a camera
sees, ``traffic`` makes a scene of them (``worlds.scene``), in which some carry cameras, and
``source`` has the settings in a scenario.

It is a world and no drive's frames (``data.intake``): its file has no detections, and what a car
sees is computed at the car's own times.
"""
