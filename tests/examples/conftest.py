"""Tests of examples run in their folder, as their pages say."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.checkout import REPOSITORY

EXAMPLES = REPOSITORY / "examples"
sys.path.append(str(EXAMPLES))


@pytest.fixture(autouse=True)
def _in_the_folder_of_examples(_own_folder: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(EXAMPLES)
    return EXAMPLES
