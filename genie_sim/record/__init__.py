"""Rows while time runs: tables and their columns, Parquet files, provenance, and the result folder
read back.
"""
