"""What a run writes down: rows while it goes on, Parquet tables, provenance, and the result folder
read back.

It implements the simulator's ``Monitor`` and knows nothing of metrics; ``analysis`` and the runner
call it.
"""
