"""Input that is whole on the outside and wrong within: traces, truth tables and results with valid
digests, archives with other structures, values of the right type, classes that return anything.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import random
import re
import struct
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import yaml

from genie_sim.base.errors import UserError
from genie_sim.base.settings import plain_data
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data import fetch
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.data.truth import (
    RecordedTruth,
    TruthRow,
    TruthTable,
    path_beside,
    truth_beside,
    write_truth,
)
from genie_sim.record import provenance
from genie_sim.runs.folder import run_in_memory, run_to_folder
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario, read_scenario
from tests.conformance import own, small
from tests.conformance.wrong_types import CASES
from tests.data.traces import KARLSRUHE, frame
from tools.fuzz.harness import Case, Target
from tools.fuzz.mutation import VALUES, broken, changed
from tools.fuzz.settings import LONG_NS, TINY, run_command

NUMBERS: tuple[Any, ...] = (
    *(0, 1, -1, 2, 255, 2**31 - 1, 2**31, 2**62, 2**63 - 1, -(2**63)),
    *(0.0, -0.0, 1e-300, 0.5, 3.2, 90.0, 4e7, 4.1e7, 1e150, 1e308, math.nan, math.inf, -math.inf),
)
TEXTS = ("", " ", "x", "car", "person", "02", "\n", "\0", "é\u202e", "<b>", "=1+1", "x" * 5000)


def like(value: Any, rng: random.Random) -> Any:
    """Another value, mostly of the same type."""
    if rng.random() < 0.1:
        return rng.choice(VALUES)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice([number for number in NUMBERS if isinstance(number, int)])
    if isinstance(value, float):
        return rng.choice((*NUMBERS, value * rng.choice((-1, 1e-3, 10, 1e6))))
    if isinstance(value, str):
        return rng.choice(TEXTS)
    if isinstance(value, tuple) and value:
        values = list(value)
        values[rng.randrange(len(values))] = like(rng.choice(values), rng)
        return type(value)(*values) if hasattr(value, "_fields") else tuple(values)
    return rng.choice(VALUES)


def with_other_fields(row: Any, rng: random.Random) -> Any:
    """The same row, frozen dataclass or named tuple, with one or two other values."""
    names = getattr(row, "_fields", None) or [
        name for name in type(row).__dataclass_fields__ if name != "features"
    ]
    names = rng.sample(list(names), rng.randint(1, 2))
    values = {name: like(getattr(row, name), rng) for name in names}
    return row._replace(**values) if hasattr(row, "_fields") else replace(row, **values)


def wrong_trace(rng: random.Random) -> Trace:
    """A trace with other values in it, whose digest is right."""
    frames = {
        camera: [frame(camera, index) for index in range(4)]
        for camera in rng.choice((("02",), ("02", "03"), ("left", "")))
    }
    for _ in range(rng.randint(0, 2)):
        frames_of_one = rng.choice(list(frames.values()))
        place = rng.randrange(len(frames_of_one))
        seen = frames_of_one[place]
        if rng.random() < 0.5 and isinstance(seen.detections, tuple) and seen.detections:
            seen = replace(
                seen, detections=(with_other_fields(seen.detections[0], rng), *seen.detections)
            )
        else:
            seen = with_other_fields(seen, rng)
        frames_of_one[place] = seen
    if rng.random() < 0.1:
        rng.shuffle(rng.choice(list(frames.values())))
    origin = KARLSRUHE if rng.random() < 0.8 else tuple(like(x, rng) for x in KARLSRUHE)
    about: Any = {"detector": "x"} if rng.random() < 0.8 else {"parameters": rng.choice(VALUES)}
    return Trace("wrong", origin, {name: tuple(rows) for name, rows in frames.items()}, about)


def traces(folder: Path) -> Case:
    """Written with a right digest, read, moved, and simulated."""
    path = folder / "wrong.parquet"
    settings = {**yaml.safe_load(TINY), "name": "tiny", "perception": {"trace": str(path)}}
    settings["cameras"] = [{"name": "front", "recording": "02"}]

    def case(rng: random.Random) -> None:
        try:
            write_trace(path, wrong_trace(rng))
        except (ValueError, TypeError, ArithmeticError, AttributeError) as error:
            raise UserError("no such file can be written") from error
        trace = read_trace(path)
        trace.rebased(rng.choice((KARLSRUHE, (90.0, 180.0, 1e5), (-89.9, 0.0, 0.0))))
        trace.at_least(0.5)
        stamps_ns = [seen.stamp_ns for frames in trace.frames.values() for seen in frames]
        if max(stamps_ns) < 10 * LONG_NS:
            simulate(prepare(read_scenario(settings)))

    return case


def truth_tables(folder: Path) -> Case:
    """Written with a right digest, read, and used to judge."""
    path = folder / "drive.parquet"
    whole = Trace("drive", KARLSRUHE, {"02": tuple(frame("02", i) for i in range(4))}, {})
    write_trace(path, whole)

    def case(rng: random.Random) -> None:
        rows = [
            TruthRow(
                *("02", index, 103_380_000 * index, 7, "car", False, True),
                *(5.0 + index, 17.5, -0.5),
            )
            for index in range(4)
        ]
        for _ in range(rng.randint(0, 2)):
            rows[rng.randrange(4)] = with_other_fields(rows[rng.randrange(4)], rng)
        digest = whole.digest if rng.random() < 0.9 else rng.choice(TEXTS)
        origin = KARLSRUHE if rng.random() < 0.8 else tuple(like(x, rng) for x in KARLSRUHE)
        about: Any = {"drive": "x", "trace": "drive"}
        about = about if rng.random() < 0.8 else changed(about, rng)
        beside = path_beside(path)
        try:
            write_truth(beside, TruthTable(digest, origin, tuple(rows), about))
        except (ValueError, TypeError, ArithmeticError, AttributeError) as error:
            raise UserError("no such file can be written") from error
        if rng.random() < 0.2:
            beside.write_bytes(broken(beside.read_bytes(), rng))
        table = truth_beside(path, whole)
        assert table is not None
        truth = RecordedTruth(table.rebased((48.0, 9.0, 0.0)))
        place = np.array([5.0]), np.array([17.5])
        for seen in whole.frames["02"]:
            truth.visible(seen)  # type: ignore[arg-type]
            truth.are_there([seen], ["car"], *place)  # type: ignore[arg-type]

    return case


def zip_structures(folder: Path) -> Case:
    """Archives whose headers say something else than their content. Nothing may come to lie
    outside of the folder.
    """
    path, inside = folder / "in" / "wrong.zip", folder / "in" / "unpacked"
    path.parent.mkdir()
    kinds = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    # Where a header's numbers stand: signature, offsets and lengths in bytes (APPNOTE 4.3).
    headers = {
        b"PK\x03\x04": ((4, 2), (6, 2), (8, 2), (14, 4), (18, 4), (22, 4), (26, 2), (28, 2)),
        b"PK\x01\x02": (
            *((6, 2), (8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (30, 2), (32, 2)),
            *((34, 2), (38, 4), (42, 4)),
        ),
        b"PK\x05\x06": ((4, 2), (6, 2), (8, 2), (10, 2), (12, 4), (16, 4), (20, 2)),
    }

    def whole(rng: random.Random) -> bytearray:
        output = io.BytesIO()
        with zipfile.ZipFile(output, "w", rng.choice(kinds)) as packed:
            for number in range(rng.randint(1, 4)):
                name = rng.choice((f"a/{number}.txt", f"{number}", "a", "a/b", "ü.txt", "a/../b"))
                entry = zipfile.ZipInfo(name)
                entry.compress_type = rng.choice(kinds)
                entry.external_attr = rng.choice((0, 0, 0o100644, 0o120777, 0o060600)) << 16
                entry.extra = rng.choice((b"", b"\x01\x00\x08\x00" + b"\xff" * 8, b"\x01\x00"))
                with warnings.catch_warnings(action="ignore"):  # of names that are there already
                    packed.writestr(entry, rng.choice((b"", b"text" * 50, bytes(2**20))))
        return bytearray(output.getvalue())

    def case(rng: random.Random) -> None:
        content = whole(rng)
        for _ in range(rng.randint(1, 3)):
            signature = rng.choice(list(headers))
            places = [found.start() for found in re.finditer(re.escape(signature), content)]
            at, (offset, size) = rng.choice(places), rng.choice(headers[signature])
            before = int.from_bytes(content[at + offset : at + offset + size], "little")
            limit = 256**size - 1
            number = rng.choice((0, 1, before + 1, before - 1, 2 * before, 99, limit, limit // 2))
            content[at + offset : at + offset + size] = (number & limit).to_bytes(size, "little")
        if rng.random() < 0.1:
            content[0:0] = bytes(rng.randint(1, 99))
        if rng.random() < 0.1:
            content += struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 1, 1, 46, 0, 0)
        path.write_bytes(content)
        try:
            fetch.unpack(path, inside)
        finally:
            assert {entry.name for entry in folder.iterdir()} == {"in"}
            assert {entry.name for entry in path.parent.iterdir()} <= {"wrong.zip", "unpacked"}

    return case


def own_code(folder: Path) -> Case:
    """Classes of the user's own of every kind, one method of which returns anything, always or
    after some calls.
    """
    usual = {
        "methods": ["local"],
        "perception": {"source": f"{own.__name__}:Street", "speed_mps": 1.0, "seconds": 0.3},
    }
    targets = [(settings, cls, name) for settings, cls, name, _, _ in CASES.values()]
    scenarios = [small.scenario(**{**usual, **settings}) for settings, _, _ in targets]
    odd = (
        *(object(), b"", b"x", set(), iter(()), (), (None,), [()], 1j, 2**63, -1),
        *(CameraPose(0.0, 0.0, 0.0, math.nan), Detection("car", 2.0, None, None, 0.5, "x")),
        *(SimpleNamespace(), SimpleNamespace(stamp_ns=0), float("nan"), lambda *_: None),
    )

    def case(rng: random.Random) -> None:
        place = rng.randrange(len(targets))
        _, cls, name = targets[place]
        original = getattr(cls, name, None)
        values = [rng.choice((*VALUES, *odd)) for _ in range(3)]
        good, calls = rng.choice((0, 0, 1, 7)), iter(range(10**9))

        def method(*arguments: Any, **options: Any) -> Any:
            if next(calls) < good and callable(original):
                return original(*arguments, **options)
            return values[0]

        is_plain = not callable(original)
        with mock.patch.object(cls, name, values[0] if is_plain else method, create=True):
            run_in_memory(scenarios[place])

    return case


def result_contents(folder: Path) -> Case:
    """Results whose digests are right and whose content is not: every command that reads them."""
    (folder / "tiny.yaml").write_text(TINY)
    with mock.patch("genie_sim.analysis.figures.save"):
        run = run_to_folder(load_scenario(folder / "tiny.yaml"), folder / "runs").folder
    assert run is not None
    whole = {path: path.read_bytes() for path in run.iterdir() if path.is_file()}
    commands = (
        *(["report", "."], ["table", "."], ["table", ".", "--format", "csv"], ["compare", "."]),
        *(["table", ".", "--format", "latex"], ["figures", ".", "--format", "svg"], ["rerun", "."]),
        ["export", ".", "--out", str(folder / "run.mcap")],
    )

    def changed_table(path: Path, rng: random.Random) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pq.ParquetFile(path).read()
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(table.num_columns)
            column = table.schema.field(at)
            values = table.column(at).to_pylist()
            if not values:
                return
            values[rng.randrange(len(values))] = like(rng.choice(values), rng)
            with contextlib.suppress(pa.ArrowException, OverflowError, TypeError, UnicodeError):
                table = table.set_column(at, column, pa.array(values, column.type))
        if rng.random() < 0.2:
            table = table.slice(0, rng.randrange(len(table) + 1))
        try:
            pq.write_table(table, path)
        except pa.ArrowException as error:
            raise UserError("no such file can be written") from error

    def case(rng: random.Random) -> None:
        path = rng.choice(list(whole))
        try:
            if path.suffix == ".parquet":
                changed_table(path, rng)
            elif path.suffix == ".json":
                path.write_text(json.dumps(changed(json.loads(whole[path]), rng)))
            else:
                path.write_bytes(broken(whole[path], rng))
            with contextlib.suppress(ValueError, TypeError, AttributeError, KeyError):
                about = json.loads((run / "run.json").read_bytes())
                about["digests"] = provenance.digests(run, about["digests"])
                about["run_id"] = provenance.run_id(about["facts"])
                provenance.write_json(run / "run.json", about)
            with (
                contextlib.chdir(run),
                mock.patch("genie_sim.analysis.figures.save"),
                mock.patch("genie_sim.runs.folder.write", side_effect=UserError("stopped")),
            ):
                run_command(list(rng.choice(commands)))
        finally:
            for changed_path, content in whole.items():
                changed_path.write_bytes(content)

    return case


QUANTITIES = ("0", "1", "2.5", "30", "0.5", "100", "-1", "1e-9", "1e9", "9" * 30, "nan")
UNIT_WORDS = ("ns", "ms", "s", "min", "B", "kB", "MB", "Mbit/s", "Gbit/s", "m", "km", "deg", "rad")
WORDS = (
    *("exact", "dhash", "pose_grid", "lru", "lfu", "ttl", "fifo", "default"),
    *("all", "own", "confident"),
    *("literal", "newest", "tracker", "raw", "jpeg80", "wifi", "ethernet_1g", "car1", "edge1"),
)


def typed_settings(folder: Path) -> Case:
    """Every setting of a small scenario written out; some of them other values of their own type.
    What is accepted is simulated.
    """
    base = yaml.safe_load(TINY) | {"name": "tiny"}
    genies: list[Any] = [
        {},
        {"capacity": "3 entries", "similarity": "dhash", "object_map": {"forget_after": "1 s"}},
    ]
    trees = []
    for genie in genies:
        settings = base | {"genie": genie, "methods": ["remote", "genie", "recommended"]}
        trees.append(json.loads(json.dumps(plain_data(read_scenario(settings)))))

    def typed(value: Any, rng: random.Random) -> Any:
        if isinstance(value, bool):
            return not value
        if isinstance(value, int | float):
            return rng.choice((0, 1, 2, 3, 0.5, 0.9, 1.0, 0.25, -1, 1e-9, 10**6, 2**63))
        if isinstance(value, str) and re.fullmatch(r"-?[0-9.]+ \S+", value):
            unit = value.split()[1] if rng.random() < 0.8 else rng.choice(UNIT_WORDS)
            return f"{rng.choice(QUANTITIES)} {unit}"
        return rng.choice((*WORDS, None, "1 s", "1 m", 3, []))

    def leaves(tree: Any) -> Iterator[tuple[Any, Any]]:
        for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
            if isinstance(value, dict | list):
                yield from leaves(value)
            else:
                yield tree, key

    def case(rng: random.Random) -> None:
        tree = json.loads(json.dumps(rng.choice(trees)))
        places = list(leaves(tree))
        for holder, key in rng.sample(places, rng.randint(1, 3)):
            holder[key] = typed(holder[key], rng)
        scenario = read_scenario(tree)
        assert read_scenario(plain_data(scenario)) == scenario, "written and read is another one"
        ends_ns = [
            route.start_ns + route.laps * (route.pause_ns + end_ns - begin_ns)
            for route in (car.route for car in scenario.cars)
            for begin_ns, end_ns in [route.window_ns or (0, 20 * LONG_NS)]
        ]
        waits_ns = (scenario.start_jitter_ns, *(camera.phase_ns for camera in scenario.cameras))
        if max(*ends_ns, *waits_ns) < 5 * LONG_NS:
            simulate(prepare(scenario))

    return case


TARGETS = (
    Target("traces with a right digest", 100, traces),
    Target("truth tables", 100, truth_tables),
    Target("ZIP structure", 100, zip_structures),
    Target("own code", 100, own_code),
    Target("results with right digests", 20, result_contents),
    Target("typed settings", 100, typed_settings),
)
