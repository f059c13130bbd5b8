"""What others recorded or simulated: floating-car data of SUMO, tables of poses and detections."""

from __future__ import annotations

import gzip
import random
from itertools import islice
from pathlib import Path

from genie_sim.base.units import NS_PER_S
from genie_sim.data.pose_import import recordings, write_recordings
from genie_sim.worlds.traffic.source import RecordedTraffic
from tests.data.pose_tables import DETECTIONS, POSES, TRUTH
from tests.worlds.traffic.fcd_files import fcd_text
from tools.fuzz.harness import Case, Target
from tools.fuzz.mutation import broken

NUMBERS = ("nan", "inf", "-1e308", "1e-300", "0", "-0.0", "1e9", "9" * 400, "", "x", "٣", "1_0")


def traffic(folder: Path) -> Case:
    """Opens a file as a source of frames, and looks at the first frames of every car."""
    steps = []
    for k in range(8):
        places = {"a": (10.0 * k, 0.0, 90.0), "b.1": (10.0 * k - 20, 0.0, 90.0 - 3 * k)}
        if 2 <= k <= 5:
            places["c"] = (60.0, -6.0 + k, 0.0)
        steps.append((50 + 0.5 * k, places))
    text = fcd_text(steps, types={"c": "truck"})
    path = folder / "traffic.xml"

    def case(rng: random.Random) -> None:
        if rng.random() < 0.4:
            content = _one_value_changed(text, rng).encode()
        else:
            content = broken(text.encode(), rng)
        if rng.random() < 0.3:
            content = gzip.compress(content)
            if rng.random() < 0.5:
                content = broken(content, rng)
        path.write_bytes(content)
        begin_ns = rng.choice((None, 51 * NS_PER_S))
        source = RecordedTraffic(str(path), begin_ns, duration_ns=3 * NS_PER_S)
        frames = source.open(1, None)
        for car, start_ns in frames.starts_ns().items():
            drive = frames.drive(car, None, start_ns)
            for frame in islice(drive.frames["02"], 20):
                _ = frame.detections, frame.truth()

    return case


def tables(folder: Path) -> Case:
    """Imports tables, of which one is broken, and writes what comes out."""
    texts = {"poses": POSES, "detections": DETECTIONS, "truth": TRUTH}

    def case(rng: random.Random) -> None:
        name = rng.choice(list(texts))
        paths = []
        for other, text in texts.items():
            content = text.encode()
            if other == name and rng.random() < 0.4:
                content = _one_value_changed(text, rng).encode()
            elif other == name:
                content = broken(content, rng)
            paths.append(folder / f"{other}.csv")
            paths[-1].write_bytes(content)
        truth = paths[2] if name == "truth" or rng.random() < 0.5 else None
        imported = recordings(paths[0], paths[1], truth)
        out = folder / "traces"
        for path in out.glob("*"):
            path.unlink()
        write_recordings(out, imported)

    return case


def _one_value_changed(text: str, rng: random.Random) -> str:
    """One number of a text is another one, or none."""
    digits = [place for place, letter in enumerate(text) if letter.isdigit()]
    begin = end = rng.choice(digits)
    while begin and (text[begin - 1].isdigit() or text[begin - 1] in "-."):
        begin -= 1
    while end < len(text) and (text[end].isdigit() or text[end] == "."):
        end += 1
    return text[:begin] + rng.choice(NUMBERS) + text[end:]


TARGETS = (Target("traffic", 150, traffic), Target("tables", 150, tables))
