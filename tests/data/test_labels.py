"""KITTI's tracklets as files that anybody may have written."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.data.kitti.tracklets import tracklets


def write(path: Path, holder: str = "tracklets", **values: object) -> Path:
    """A file with one car that is 2 m high and was seen in two frames."""
    pose = {"tx": 1.0, "ty": 2.0, "tz": -1.5, "rz": 0.5, "occlusion": 1, "truncation": 0}
    fields = {"h": 2.0, "w": 1.6, "l": 4.0, "first_frame": 7}
    pose |= {name: value for name, value in values.items() if name in pose}
    fields |= {name: value for name, value in values.items() if name in fields}
    item = "".join(f"<{name}>{value}</{name}>" for name, value in pose.items())
    size = "".join(f"<{name}>{value}</{name}>" for name, value in fields.items())
    path.write_text(
        f"<b><{holder}><item><objectType>Car</objectType>{size}"
        f"<poses>{2 * f'<item>{item}</item>'}</poses></item></{holder}></b>"
    )
    return path


def test_a_tracklet_stands_on_its_given_place(tmp_path: Path):
    (car,) = tracklets(write(tmp_path / "labels.xml"))
    assert (car.kind, car.first, car.size_m) == ("Car", 7, (2.0, 1.6, 4.0))
    assert car.centres == pytest.approx(np.array([[1.0, 2.0, -0.5]] * 2)), "half its height up"
    assert car.occlusion == (1, 1) and car.truncation == (0, 0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *itertools.product(("tx", "rz", "h", "l"), ("nan", "inf", "1e300", "x", "")),
        ("holder", "poses"),
    ],
)
def test_what_no_tracklet_has_is_refused(tmp_path: Path, name: str, value: str):
    with pytest.raises(UserError, match=r"labels\.xml: not KITTI tracklets: "):
        tracklets(write(tmp_path / "labels.xml", **{name: value}))
