"""Sweeps that pages are made of."""

from __future__ import annotations

from pathlib import Path

from genie_sim.cli import main


def swept(text: str, folder: Path, name: str) -> Path:
    file = folder / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    assert main(["sweep", str(file), "--out", str(folder), "--jobs", "1"]) == 0
    return folder / name
