"""Features of frames: short vectors by which similarity caches find pictures that are alike."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.features import UNIT, packed, unpacked
from genie_sim.core.messages import CameraPose
from genie_sim.data.detectors.onnx_session import add_last_activation
from genie_sim.data.trace import Trace, feature_facts, read_trace, write_trace
from genie_sim.worlds.scene.keys import mix
from genie_sim.worlds.scene.surrogate import Surrogate

# how the digest of the shipped trace begins; it does not depend on features
SHIPPED = "c43932bb6f14f1ac"
NAMES = ("hsv", "yolox_gap")


@pytest.fixture(scope="module")
def shipped() -> Trace:
    return read_trace(files.find(files.TRACE, "kitti_0005"))


def medians(vectors: np.ndarray, lags: tuple[int, ...]) -> np.ndarray:
    apart = [np.linalg.norm(vectors[lag:] - vectors[:-lag], axis=1) for lag in lags]
    return np.array([np.median(one) for one in apart])


def test_the_shipped_trace_has_both_and_its_detections_are_what_they_were(shipped):
    assert shipped.digest.startswith(SHIPPED)
    assert set(shipped.provenance["features"]) == set(NAMES)
    assert all(facts["dimension"] == 64 for facts in shipped.provenance["features"].values())


def test_a_trace_keeps_features_finds_changed_ones_and_needs_none(shipped, tmp_path):
    frames = {"02": shipped.frames["02"][:3]}
    for known in ({}, {"features": feature_facts("x", frames)}):
        write_trace(tmp_path / "some.parquet", Trace("some", shipped.origin, frames, known))
        assert read_trace(tmp_path / "some.parquet").frames == frames
    first, *others = frames["02"]
    other = {"02": (replace(first, features=first.features | {"hsv": bytes(64)}), *others)}
    write_trace(tmp_path / "other.parquet", Trace("some", shipped.origin, other, known))
    with pytest.raises(UserError, match=r"other\.parquet: features do not match"):
        read_trace(tmp_path / "other.parquet")
    bare = {"02": tuple(replace(one, features={}) for one in frames["02"])}
    write_trace(tmp_path / "bare.parquet", Trace("some", shipped.origin, bare, {}))
    assert read_trace(tmp_path / "bare.parquet").frames == bare
    assert (
        Trace("", shipped.origin, bare, {}).digest == Trace("", shipped.origin, frames, {}).digest
    )


@pytest.mark.parametrize("wrong", [{}, {"own": b"short"}, {"own": "a text."}, {"own": None}])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_frame_of_other_features_is_refused(shipped, tmp_path, wrong, place):
    frames = [replace(one, features={"own": b"7 bytes"}) for one in shipped.frames["02"][:3]]
    frames[place] = replace(frames[place], features=wrong)
    with pytest.raises(UserError, match=r"^\S*x\.parquet: camera '02', frame .: feature 'own' is "):
        write_trace(tmp_path / "x.parquet", Trace("x", shipped.origin, {"02": tuple(frames)}, {}))
    assert not list(tmp_path.iterdir())


def test_packing_keeps_distances():
    rng = np.random.default_rng(1)
    vectors = rng.random((40, 128)) ** 4
    unit = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    short = np.array([unpacked(packed(one)) for one in vectors]) / UNIT
    ratios = [
        np.linalg.norm(short[i] - short[j]) / np.linalg.norm(unit[i] - unit[j])
        for i in range(40)
        for j in range(i)
    ]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.03)
    assert np.std(ratios) < 0.12
    assert packed(vectors[0]) == packed(7.0 * vectors[0])
    assert packed(np.zeros(5)) == bytes(64)


def test_the_last_activation_is_found_by_the_structure_of_the_network():
    from onnx import helper

    def graph(*joined: str):
        nodes = [
            helper.make_node("MaxPool", ["x"], ["small"]),
            helper.make_node("MaxPool", ["x"], ["large"]),
            helper.make_node("Concat", ["x", *joined], ["all"]),
            helper.make_node("Conv", ["all", "w"], ["c"]),
            helper.make_node("Sigmoid", ["c"], ["s"]),
            helper.make_node("Mul", ["c", "s"], ["a"]),
            helper.make_node("Relu", ["a"], ["later"]),
        ]
        return helper.make_graph(nodes, "made up", [], [])

    pooled, plain = graph("small", "large"), graph("small")
    assert add_last_activation(pooled)
    assert [one.name for one in pooled.output] == ["a"]
    assert not add_last_activation(plain)
    assert not plain.output


@pytest.mark.usefixtures("kitti_root", "weights_dir")
def test_perceive_makes_the_shipped_features_again(shipped):
    from genie_sim.data.kitti.perceive import FrameSelection, perceive

    numbers = range(0, 150, 30)
    made = perceive(None, FrameSelection("2011_09_26/0005", numbers=numbers))
    for camera, frames in made.frames.items():
        for frame, number in zip(frames, numbers, strict=True):
            for name in NAMES:
                ours, theirs = (
                    unpacked(frame.features[name]),
                    unpacked(shipped.frames[camera][number].features[name]),
                )
                assert np.abs(ours - theirs).max() <= 1, (
                    "a last digit may differ between processors"
                )


@pytest.mark.parametrize("name", NAMES)
def test_a_town_s_surrogates_are_as_far_apart_as_real_ones(shipped, name: str):
    lags = (2, 5, 10, 20, 50)
    frames = shipped.frames["02"]
    real = medians(np.array([unpacked(one.features[name]) for one in frames]), lags)
    step_m = np.mean(
        [np.hypot(b.pose[0] - a.pose[0], b.pose[1] - a.pose[1]) for a, b in pairwise(frames)]
    )
    made = []
    for seed in range(8):
        surrogate = Surrogate(seed, name)
        poses = [CameraPose(i * step_m, 0.0, 1.6, 0.0) for i in range(200)]
        found = np.array([unpacked(surrogate.at(pose, mix(i))) for i, pose in enumerate(poses)])
        assert surrogate.at(poses[7], mix(7)) == Surrogate(seed, name).at(poses[7], mix(7))
        made.append(medians(found, lags))
    assert np.mean(made, axis=0) == pytest.approx(real, rel=0.35 if name == "hsv" else 0.15)
