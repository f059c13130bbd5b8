"""Sweeps that several files of tests look at; each is run once, whatever the number of workers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.once import made_once


@pytest.fixture(scope="session")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _sweep(tmp_path_factory, "town")


@pytest.fixture(scope="session")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _sweep(tmp_path_factory, "crossed")


@pytest.fixture(scope="session")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _sweep(tmp_path_factory, "drawn")


def _sweep(factory: pytest.TempPathFactory, name: str) -> Path:
    from tests.report import sweeps

    text = getattr(sweeps, name.upper())
    return made_once(factory, f"sweep_{name}", lambda into: sweeps.swept(text, into, name)) / name
