"""Traces are written, read, moved to another origin, and refused where something is wrong with
them.
"""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pymap3d
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.parquet import METADATA_KEY
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data import trace as trace_file
from genie_sim.data.trace import POSITION_DECIMALS, Trace, read_trace, sequence_of, write_trace
from tests.make import KARLSRUHE, trace, trace_frame

SHIPPED = Path(__file__).parents[2] / "scenarios" / "traces" / "kitti_0005.parquet"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "drive.parquet"


def rewritten(path, change):
    """The file at ``path`` with its Arrow table changed, as another program might have."""
    pq.write_table(change(pq.ParquetFile(path).read()), path)


def with_metadata(**changes):
    def change(table):
        metadata = json.loads(table.schema.metadata[METADATA_KEY]) | changes
        return table.replace_schema_metadata({METADATA_KEY: json.dumps(metadata)})

    return change


def with_car(**changes):
    """One frame in which a car was found."""
    return (trace_frame(detections=(replace(Detection("car", 0.5, None, None, 0.5), **changes),)),)


def test_what_is_written_is_read(path):
    write_trace(path, trace())
    assert read_trace(path) == trace()
    # nothing half-written stays
    assert [p.name for p in path.parent.iterdir()] == ["drive.parquet"]


def test_same_trace_same_bytes(path, tmp_path):
    write_trace(path, trace())
    write_trace(tmp_path / "again.parquet", trace())
    assert path.read_bytes() == (tmp_path / "again.parquet").read_bytes()


def test_digest_follows_the_content_only():
    original = trace()
    assert replace(original, name="other", provenance={}).digest == original.digest
    moved_box = replace(original.frames["02"][0].detections[0], box=(10.0, 20.0, 60.0, 50.01))
    changed = trace_frame(detections=(moved_box,))
    assert trace(**{"02": (changed,)}).digest != trace(**{"02": (trace_frame(),)}).digest
    assert (
        replace(original, frames=dict(reversed(original.frames.items()))).digest == original.digest
    )
    assert replace(original, origin=(49.0, 8.4, 112.8)).digest != original.digest


def test_rebased_trace_shows_the_same_places_on_earth():
    elsewhere = (49.02, 8.45, 100.0)
    before, after = trace(), trace().rebased(elsewhere)
    for old, new in zip(before.frames["02"], after.frames["02"], strict=True):
        places = [(old.pose[:3], new.pose[:3])]
        places += [
            (a.location, b.location)
            for a, b in zip(old.detections, new.detections, strict=True)
            if a.location
        ]
        for old_enu, new_enu in places:
            on_earth = pymap3d.enu2geodetic(*old_enu, *KARLSRUHE)
            exact = pymap3d.geodetic2enu(*on_earth, *elsewhere)
            assert new_enu == tuple(round(x, POSITION_DECIMALS) for x in exact)
        assert [d.location for d in new.detections if d.label == "stop sign"] in ([None], [])
    # Seen from 2 km further east, the old north leans to the east: meridians meet at the pole.
    convergence_rad = math.radians(elsewhere[1] - KARLSRUHE[1]) * math.sin(math.radians(49.01))
    turned_rad = after.frames["02"][0].pose.heading_rad - before.frames["02"][0].pose.heading_rad
    assert turned_rad == pytest.approx(-convergence_rad, rel=0.02)


def test_rebasing_there_and_back_changes_nothing():
    back = trace().rebased((49.02, 8.45, 100.0)).rebased(KARLSRUHE)
    for old, new in zip(trace().frames["02"], back.frames["02"], strict=True):
        assert new.pose == pytest.approx(old.pose, abs=10**-POSITION_DECIMALS)
    assert trace().rebased(KARLSRUHE) == trace()


def test_a_truncated_file_is_refused_wherever_it_ends(path):
    write_trace(path, trace())
    whole = path.read_bytes()
    for length in np.linspace(0, len(whole) - 1, 40, dtype=int):
        path.write_bytes(whole[:length])
        with pytest.raises(
            UserError, match=r"drive\.parquet: not a readable Parquet file"
        ) as error:
            read_trace(path)
        assert "\n" not in str(error.value)


def test_a_damaged_file_is_read_right_or_refused(path):
    """One byte changed anywhere: the trace comes out as it was, or there is a UserError; never
    another trace.
    """
    write_trace(path, trace())
    whole = bytearray(path.read_bytes())
    refusals = 0
    for position in range(0, len(whole), max(1, len(whole) // 400)):
        damaged = bytearray(whole)
        damaged[position] ^= 0xFF
        path.write_bytes(damaged)
        try:
            assert read_trace(path).frames == trace().frames
        except UserError:
            refusals += 1
    assert refusals > 100


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            with_metadata(format_version=99),
            "format_version: trace has version 99, this genie-sim reads 1",
        ),
        (with_metadata(origin=[49.0]), "origin"),
        (with_metadata(origin=[1e308, 8.0, 100.0]), "origin"),
        (
            lambda table: table.replace_schema_metadata({METADATA_KEY: b"[" * 100_000}),
            "metadata cannot be read",
        ),
        (with_metadata(digest="0" * 64), "does not match its own digest"),
        (with_metadata(provenance=None), "'provenance' is missing"),
        (
            lambda table: table.replace_schema_metadata({METADATA_KEY: b"{"}),
            "metadata cannot be read",
        ),
        (lambda table: table.drop_columns(["dhash"]), "column dhash: missing, or not uint64"),
        (
            lambda table: table.set_column(2, "stamp_ns", pa.array([0.0] * 7)),
            "column stamp_ns: missing, or not int64",
        ),
        (
            lambda table: table.set_column(0, "camera", pa.array(["02"] * 6 + [None])),
            "'camera' has empty values",
        ),
        (
            lambda table: table.append_column("feature_x", pa.array([b"1"] * 6 + [None])),
            "'feature_x' has empty values",
        ),
        (lambda table: table.slice(0, 0), "no frames"),
        (lambda table: table.slice(1), "does not match its own digest"),
    ],
)
def test_a_trace_with_something_wrong_is_refused(path, change, message):
    write_trace(path, trace())
    rewritten(path, change)
    with pytest.raises(UserError, match=message) as error:
        read_trace(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (
            (trace_frame(index=1), trace_frame(index=0)),
            "frame 0: stamp_ns 0 does not follow 103380000",
        ),
        ((trace_frame(), trace_frame(stamp_ns=1)), "frame 0: index does not follow 0"),
        ((trace_frame(pose=CameraPose(0.0, math.nan, 0.0, 0.0)),), "pose"),
        (
            (trace_frame(pose=CameraPose(0.0, 0.0, 0.0, 1e308)),),
            "is no place on Earth .* and a heading",
        ),
        ((trace_frame(pose=CameraPose(1e308, 0.0, 0.0, 0.0)),), "is no place on Earth"),
        ((trace_frame(stamp_ns=-1),), "stamp_ns"),
        ((trace_frame(width=0),), "width"),
        ((trace_frame(horizontal_fov_rad=0.0),), "horizontal_fov_rad"),
        (with_car(score=1.0000001), "a car of score 1.0000001; must be from 0 to 1"),
        (with_car(box=(0.0, 0.0, math.inf, 1.0)), "must be texts, and numbers in range"),
        (with_car(location=(1e308, 0.0, 0.0)), "must be texts, and numbers in range"),
        (with_car(score=None), "must be texts, and numbers in range"),
        (with_car(label=None), "must be texts, and numbers in range"),
        (with_car(box=(0.0, None, 1.0, 1.0)), "must be texts, and numbers in range"),
    ],
)
def test_a_trace_with_impossible_frames_is_refused(path, frames, message):
    write_trace(path, trace(**{"02": frames}))
    with pytest.raises(UserError, match=message):
        read_trace(path)


def test_parameters_that_are_no_mapping_are_refused(path):
    whole = trace()
    write_trace(path, replace(whole, provenance={"parameters": ["min_score"]}))
    with pytest.raises(UserError, match="provenance: 'parameters' is not a mapping"):
        read_trace(path)


def test_a_detection_may_have_no_box(path):
    boxless = trace(**{"02": with_car(location=(1.0, 2.0, 3.0))})
    write_trace(path, boxless)
    assert read_trace(path).frames == boxless.frames


def test_an_unwritable_place_is_a_user_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_trace(tmp_path / "file" / "drive.parquet", trace())


@pytest.mark.parametrize("metadata", [(), ("maker",)])
def test_a_trace_takes_the_place_of_its_own_earlier_file(path, monkeypatch, metadata):
    """Also when one day its file tells more: what is written is what is asked for."""
    monkeypatch.setattr(trace_file, "METADATA", (*trace_file.METADATA, *metadata))
    monkeypatch.setattr(Trace, "maker", "me", raising=False)
    write_trace(path, trace())
    trace_file.check_replaceable(path)


def test_the_shipped_trace_is_the_whole_drive():
    shipped = read_trace(SHIPPED)
    assert {camera: len(frames) for camera, frames in shipped.frames.items()} == {
        "02": 154,
        "03": 154,
    }
    for frames in shipped.frames.values():
        assert [f.index for f in frames] == list(range(154))
        assert {f.size_bytes for f in frames} == {1_397_297}
        assert np.diff([f.stamp_ns for f in frames]) == pytest.approx(103.4e6, rel=0.02)
        steps_m = np.linalg.norm(np.diff([f.pose[:2] for f in frames], axis=0), axis=1)
        assert steps_m.max() < 1.5  # a town street: below 54 km/h
    assert "CC BY-NC-SA" in shipped.provenance["data"]


def lidar_frame(index=0, **changes):
    scan = {"kind": "lidar", "width": 0, "height": 0, "horizontal_fov_rad": 6.283185}
    return trace_frame("lidar", index, **(scan | changes))


def test_a_lidar_looks_all_around_and_has_no_picture(path):
    original = trace(lidar=(lidar_frame(0), lidar_frame(1)))
    write_trace(path, original)
    again = read_trace(path)
    assert again == original and again.frames["lidar"][0].kind == "lidar"
    assert (
        trace(lidar=(trace_frame("lidar"),)).digest
        != trace(lidar=(trace_frame("lidar", kind="lidar"),)).digest
    )


def test_a_trace_of_cameras_has_no_column_for_their_kind(path):
    write_trace(path, trace(front=(trace_frame("front"),)))
    assert "kind" not in pq.ParquetFile(path).schema_arrow.names
    assert read_trace(path).frames["front"][0].kind == "camera"


@pytest.mark.parametrize(
    ("bad", "field"),
    [
        (trace_frame(kind="radar"), "camera, lidar"),
        (trace_frame(horizontal_fov_rad=3.2), "horizontal_fov_rad"),
        (lidar_frame(horizontal_fov_rad=6.3), "horizontal_fov_rad"),
        (lidar_frame(width=10), "width"),
        (lidar_frame(size_bytes=0), "size_bytes"),
        (trace_frame(height=0), "height"),
    ],
)
def test_impossible_sensors_are_refused(path, bad, field):
    write_trace(path, trace(**{bad.camera: (bad,)}))
    with pytest.raises(UserError, match=field):
        read_trace(path)


def test_a_recording_keeps_the_sequence_that_it_is_of(path):
    alone = trace()
    together = replace(alone, sequence="street 7")
    write_trace(path, together)
    assert (read_trace(path), sequence_of(path)) == (together, "street 7")
    assert together.digest != alone.digest, "it decides what is replayed at one time"
    assert together.rebased((49.0, 8.0, 100.0)).sequence == "street 7"
    write_trace(path, alone)
    assert (read_trace(path).sequence, sequence_of(path)) == (None, None)


def test_a_sequence_without_a_name_is_refused(path):
    write_trace(path, replace(trace(), sequence=""))
    for read in (read_trace, sequence_of):
        with pytest.raises(UserError, match="metadata: sequence '' is no name"):
            read(path)
