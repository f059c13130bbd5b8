"""Files and frames of others, and what a run makes of them. From a file to a run:

- A *reader* (``kitti.perceive``, ``table_import``, and that of bags in genie-sim-ros) finds when
  and from where each frame was taken and what was detected in it (``reader_frames``); where there
  are pictures and scans, with ``detectors`` and ``detectors.placement``. What objects did between
  the rows of a table of truth, ``truth_tracks`` tells.
- All of them hand that to ``intake.traces``, the gate: it alone orders, numbers, checks and rounds,
  and gives each car a ``trace.Trace`` and, where it is known what was there, a
  ``truth.TruthTable``. (KITTI's labels come to a trace later: ``kitti.drive_truth``.)
- Both are written and read as Parquet files, ``NAME.parquet`` and ``NAME.truth.parquet``, by way of
  ``world_table``, whose metadata and digests are the same for both.
- ``sources`` opens traces for a run, each with the truth and the trace of the encoded pictures
  (``encoding``) beside it. A run knows only what ``frame_source`` says of a source; ``worlds`` has
  others.

No reader of frames are ``link_import``, which makes recordings of links out of measurements, and
``fetch``, which downloads drives and weights. Heavy libraries are imported late.

Docstrings of what users implement (``frame_source``, ``detectors.image_detector``) repeat the types
of the signature; all others do not.
"""
