"""Tests of examples find their classes as somebody does who has changed into ``examples/``."""

from __future__ import annotations

import pytest

from tests.checkout import REPOSITORY


@pytest.fixture(autouse=True)
def _in_examples(_own_folder: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(REPOSITORY / "examples")
    monkeypatch.syspath_prepend(str(REPOSITORY / "examples"))
