"""Floating-car data for tests."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Mapping
from pathlib import Path

Place = tuple[float, float, float]  # x and y of the front bumper [m], and the angle [degrees]


def fcd_text(
    steps: Iterable[tuple[float, Mapping[str, Place]]], types: Mapping[str, str] | None = None
) -> str:
    """The text of a file: each step is a time [s] and the vehicles that are there."""
    lines = ["<fcd-export>"]
    for time_s, vehicles in steps:
        lines.append(f'<timestep time="{time_s:.2f}">')
        for name, (x_m, y_m, angle_deg) in vehicles.items():
            kind = (types or {}).get(name, "passenger")
            lines.append(
                f'<vehicle id="{name}" x="{x_m}" y="{y_m}" angle="{angle_deg}" type="{kind}"/>'
            )
        lines.append("</timestep>")
    return "\n".join([*lines, "</fcd-export>", ""])


def write_fcd(path: Path, *content: object, **more: object) -> Path:
    """Writes ``fcd_text`` of the same arguments, compressed if the path ends in ``.gz``."""
    data = fcd_text(*content, **more).encode()  # type: ignore[arg-type]
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path
