"""Detectors of objects in pictures, and where the objects in their boxes are.

``detector`` has them by name, and the settings of the one that looks; ``image_detector`` says what
each must and may have, and checks what it finds in a picture. ``networks`` are the shipped
families, which ``onnx_detector`` runs, ``onnx_session`` opens and ``boxes`` thins out.
``placement`` finds the object of a box in a scan or on the ground, ``shape`` the middle of a
vehicle of which the scan sees two sides. ``detector_laws`` are how often detectors are right,
measured on drives.
"""
