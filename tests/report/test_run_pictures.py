"""Recorded pictures under what cars hold, on the page of a run: read from their own files, or
copied where somebody asks for it.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main
from genie_sim.data.trace import read_trace
from genie_sim.report import html_page, replay_pictures
from genie_sim.report.run_pictures import kitti_pictures
from tests.browser import Browser

TRACE = Path(gs.__file__).parents[1] / "scenarios" / "traces" / "kitti_0005.parquet"
WINDOWS = {"cars[0].route.window": ["0 s", "1 s"], "cars[1].route.window": ["0.5 s", "1.2 s"]}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> gs.Run:
    settings = {**WINDOWS, "cars[0].route.laps": 2}
    return gs.run("street_2car_homo", settings, out=tmp_path_factory.mktemp("runs"))


def replay_of(page: str) -> dict:
    (text,) = re.findall(r'id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)["replay"]


def test_each_frame_has_the_picture_that_was_recorded_there(run, kitti_root: Path):
    """Told by where the camera stood, over laps and windows."""
    poses = {
        (frame.camera, frame.index): (frame.pose.east_m, frame.pose.north_m)
        for sequence in read_trace(TRACE).frames.values()
        for frame in sequence
    }
    pictures = kitti_pictures(run, kitti_root, copied=False)
    rows = run.poses.query("stream == 'camera_02'")
    assert len(pictures.paths) == len(rows) > 25
    for row in rows.itertuples():
        path = pictures.paths[row.car, "camera_02", row.frame]
        camera = path.parent.parent.name.removeprefix("image_")
        assert poses[camera, int(path.stem)] == (row.east_m, row.north_m)


def test_pictures_stay_where_they_are_unless_copies_are_asked_for(
    run, kitti_root: Path, browser: Browser
):
    folder = str(run.folder)
    plain, shown, copied = (run.folder / f"{name}.html" for name in ("report", "shown", "copied"))
    assert main(["report", folder, "--out", str(shown), "--pictures", str(kitti_root)]) == 0
    options = ["--pictures", str(kitti_root), "--copy-pictures"]
    assert main(["report", folder, "--out", str(copied), *options]) == 0
    drawn = []
    for page in (plain, shown, copied):
        browser.requests.clear()
        browser.open(page)
        browser.evaluate("new Promise(done => setTimeout(done, 300))")
        assert browser.errors == []
        both = "['camera', 'camera-b'].map((id) => byId(id).width * byId(id).height)"
        assert min(browser.evaluate(both)) > 10_000
        files = [address for address in browser.requests if address.endswith((".jpg", ".png"))]
        assert bool(files) == (page == shown)
        assert ("CC BY-NC-SA 3.0" in browser.evaluate("byId('attribution').textContent")) == (
            page != plain
        )
        browser.evaluate("byId('camera').scrollIntoView({block: 'center', behavior: 'instant'})")
        drawn.append(len(browser.screenshot()))
    assert drawn[1] > drawn[0] and drawn[2] > drawn[0], "a picture takes more than boxes"
    assert "data:image" not in shown.read_text() and "data:image" in copied.read_text()
    assert str(kitti_root) not in copied.read_text(), "nobody learns of this computer's folders"


def test_a_page_holds_a_bounded_number_of_copies(run, kitti_root: Path, monkeypatch):
    monkeypatch.setattr(replay_pictures, "MAX_PICTURES", 4)
    pictures = kitti_pictures(run, kitti_root, copied=True)
    page = html_page.page(run, pictures=pictures)
    shown = replay_of(page)["pictures"]
    assert len(shown["addresses"]) == 4
    assert set(shown["of_frame"]) == {-1, 0, 1, 2, 3}
    assert "The page holds 4 of 12 pictures, the first ones." in page
    linked = replay_of(html_page.page(run, pictures=kitti_pictures(run, kitti_root, copied=False)))
    assert len(linked["pictures"]["addresses"]) == 12


def test_another_picture_is_not_shown(run, kitti_root: Path, tmp_path: Path):
    root = tmp_path / "kitti"
    for path in kitti_root.rglob("*"):
        if path.is_file() and "2011_09_26" in path.parts:
            target = root / path.relative_to(kitti_root)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.symlink_to(path)
    (name,) = root.glob("*/2011_09_26_drive_0005_sync/image_02/data/0000000003.jpg")
    name.unlink()
    shutil.copy(name.with_name("0000000004.jpg"), name)
    with pytest.raises(UserError, match=r"0000000003\.jpg: is not the picture that the trace"):
        kitti_pictures(run, root, copied=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--copy-pictures"], "--copy-pictures: --pictures says where they are"),
        (["--pictures", "nowhere"], "nowhere: no such KITTI folder"),
    ],
)
def test_what_cannot_be_shown_gets_one_line(run, options, message, capsys):
    assert main(["report", str(run.folder), *options]) == 1
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


def test_a_run_without_recorded_pictures_says_so(tmp_path: Path):
    in_town = gs.run("fleet_30", {"fleet.cars": 2, "perception.duration": "1 s"})
    with pytest.raises(UserError, match="only the cameras of recorded drives have pictures"):
        kitti_pictures(in_town, tmp_path, copied=False)
