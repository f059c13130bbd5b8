"""Tests of the tools: ``python -m pytest tools``."""

from tests.conftest import _no_fsync, _own_folder

__all__ = ["_no_fsync", "_own_folder"]
