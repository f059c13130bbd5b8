"""Files of numbers, and places on the Earth: what is read, and what is refused by line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.data import geodesy
from genie_sim.data.kitti import number_files
from genie_sim.data.kitti.oxts import read_oxts, world_SE3_imu

HERE = (49.0, 8.4, 112.0)  # latitude [deg], longitude [deg], altitude [m]


def written(text: str) -> Path:
    path = Path("numbers.txt")
    path.write_text(text)
    return path


def test_rows_may_have_blanks_or_commas_and_empty_lines_after_them():
    table = number_files.numbers(written("1 2,3\n4,5 6\n\n \n"), 3)
    assert table.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert number_files.numbers(written("\n"), 3).shape == (0, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2\n3\n", "line 2: 1 fields, expected 2"),
        ("1 2\n\n3 4\n", "line 2: is empty"),
        ("1 2\n,\n3 4\n", "line 2: is empty"),
        ("1 x\n", "line 1: could not convert string to float: 'x'"),
        ("1 nan\n", "line 1: a number is not finite, or too large"),
        ("1 -1e9\n", "line 1: a number is not finite, or too large"),
    ],
)
def test_a_wrong_line_is_named(text: str, message: str):
    with pytest.raises(UserError, match=f"numbers.txt: {message}"):
        number_files.numbers(written(text), 2)


def test_numbers_are_below_a_thousand_million():
    assert number_files.are_plausible([0.999e9, -0.999e9]) and not number_files.are_plausible(
        [0, 1e9]
    )


def test_matrices_by_any_of_their_names():
    rows = number_files.named_rows(written("P: 1 0 0 0 2 0 0 0 4\n,\nT 1 0 0 1 0 1 0 1 0 0 1 1\n"))
    path = Path("numbers.txt")
    camera, place = number_files.matrices(path, rows, [(("Q", "P"), 3), (("T",), 4)])
    assert camera.tolist() == [[1, 0, 0], [0, 2, 0], [0, 0, 4]]
    assert place.tolist() == [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]]
    for names, columns, message in (
        (("R",), 3, "R is missing or has not 9 numbers"),
        (("P",), 4, "P is missing or has not 12 numbers"),
        (("bad",), 3, "bad is not a matrix that can be inverted"),
        (("huge",), 3, "huge is not a matrix that can be inverted"),
    ):
        more = {**rows, "bad": ["1"] * 9, "huge": ["1e9", *"000100", "0", "1"]}
        with pytest.raises(UserError, match=message):
            number_files.matrices(path, more, [(names, columns)])
    thin = {"thin": ["1e-4", "0", "0", "0", "1e-4", "0", "0", "0", "1e-2"]}
    with pytest.raises(UserError, match="thin is not a matrix that can be inverted"):
        number_files.matrices(path, thin, [(("thin",), 3)])


def packet(**changed: float) -> str:
    values = {"lat": 49.0, "lon": 8.4, "alt": 112.0, "roll": 0.0, "pitch": 0.0, "yaw": 1.0}
    return " ".join(map(str, [*(values | changed).values(), *[0.0] * 24]))


@pytest.mark.parametrize(
    ("changed", "place"),
    [
        ({"lat": -90.5}, 1),
        ({"lon": 180.5}, 2),
        ({"alt": -1.1e5}, 3),
        ({"roll": 7.5}, 4),
        ({"pitch": -7.5}, 5),
        ({"yaw": 7.5}, 6),
    ],
)
def test_a_packet_is_on_the_earth(changed: dict[str, float], place: int):
    whole = number_files.numbers(written(f"{packet()}\n"), 30)
    assert read_oxts(Path("numbers.txt")).tolist() == whole[:, :6].tolist()
    (value,) = changed.values()
    written(f"{packet()}\n{packet(**changed)}\n")
    with pytest.raises(UserError, match=f"packet 2: value {place} is {value:g}, out of range"):
        read_oxts(Path("numbers.txt"))
    with pytest.raises(UserError, match="the file is empty"):
        read_oxts(written("\n"))


def test_places_near_the_origin_in_metres():
    """A degree of latitude is about 111.2 km, of longitude so much times the cosine."""

    def place(latitude: float, longitude: float, altitude_m: float) -> np.ndarray:
        at = np.array([latitude, longitude, altitude_m, 0.0, 0.0, 0.5])
        return world_SE3_imu(at, HERE)

    assert place(*HERE)[:3, 3] == pytest.approx(0, abs=1e-6)
    north = place(HERE[0] + 1e-3, HERE[1], HERE[2])[:3, 3]
    assert north == pytest.approx((0, 111.2, 0), abs=0.2)
    east = place(HERE[0], HERE[1] + 1e-3, HERE[2])[:3, 3]
    assert east == pytest.approx((111.2 * np.cos(np.radians(49)), 0, 0), abs=0.4)
    assert place(HERE[0], HERE[1], HERE[2] + 5)[:3, 3] == pytest.approx((0, 0, 5), abs=1e-6)
    turned = place(*HERE)[:3, :3]
    assert turned[:, 0] == pytest.approx((np.cos(0.5), np.sin(0.5), 0), abs=1e-9)


def test_frames_of_two_origins_differ_by_a_rigid_motion():
    there = (49.01, 8.41, 100.0)
    motion = geodesy.enu_SE3_enu(HERE, there)
    assert motion[:3, :3] @ motion[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
    assert geodesy.enu_SE3_enu(there, HERE) @ motion == pytest.approx(np.eye(4), abs=1e-6)
    assert geodesy.enu_SE3_enu(HERE, HERE) == pytest.approx(np.eye(4), abs=1e-6)
