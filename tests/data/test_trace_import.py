"""What is wrong in a drive is refused or told whichever reader reads it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.data.made_drives import CHECKS, READERS, cases, steady, told


@pytest.mark.parametrize(("reader", "check"), cases(*READERS))
def test_what_is_wrong_is_refused_or_told_by_every_reader(tmp_path: Path, reader: str, check: str):
    drive, message, is_refused, _ = CHECKS[check]
    refused, lines = told(READERS[reader], drive, tmp_path)
    assert any(re.search(message, line) for line in lines), lines
    assert refused == is_refused and not any("\n" in line for line in lines)


@pytest.mark.parametrize("reader", READERS)
def test_of_a_drive_that_is_right_nothing_is_told(tmp_path: Path, reader: str):
    assert told(READERS[reader], steady(), tmp_path) == (False, [])
