"""The report of a run: one page, offline, safe, the same bytes each time; and what its reader does
with it.
"""

from __future__ import annotations

import base64
import copy
import re
from collections.abc import Iterator
from dataclasses import replace
from html import escape, unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import genie_sim as gs
from genie_sim.analysis import figures, screen, style
from genie_sim.analysis.compare import compare
from genie_sim.analysis.verdict import verdicts
from genie_sim.cli.main import main
from genie_sim.record.columns import Text
from genie_sim.report import pages, replay, template
from tests.browser import Browser
from tests.report.pages import EVIL, MEGABYTE, asked_for, middle, picture, replay_of

NS = 1_000_000_000


def short_run(
    scenario: str = "street_3car_hetero", cars: int = 3, seconds: float = 2.0, **settings: object
) -> gs.Run:
    windows = {f"cars[{i}].route.window": ["0 s", f"{seconds} s"] for i in range(cars)}
    return gs.run(scenario, windows | settings)


@pytest.fixture(scope="module")
def run() -> gs.Run:
    return short_run(judged="all")  # by cameras whose views overlap


@pytest.fixture(scope="module")
def page(run: gs.Run) -> str:
    return pages.of_run(run, figures.makers(run))


# What the page holds


def test_the_page_names_no_other_address(page):
    """Neither the page nor its script asks for anything; its policy forbids it besides."""
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) <= {"http://www.w3.org/2000/svg"}
    assert all(source.startswith("data:image/svg") for source in re.findall(r'src="([^"]*)', page))
    assert not re.findall(r"@import|url\(", page)
    assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', page))
    assert "default-src 'none'" in page


def test_the_same_run_gives_the_same_page_without_any_clock(run, page):
    assert pages.of_run(run, {}) == pages.of_run(run, {})
    assert "wall_time" not in page


def test_every_frame_of_a_short_run_is_in_the_replay(run, page):
    shown = replay_of(page)
    stamps = np.concatenate([np.cumsum(stream["stamp_us"]) for stream in shown["streams"]])
    poses = run.poses.sort_values(["car", "stream", "frame"])
    assert stamps.tolist() == (poses["stamp_ns"] // 1000).tolist()
    assert [one["name"] for one in shown["methods"]] == list(run.facts["scenario"]["methods"])
    for one in shown["methods"]:
        mine = run.frames[run.frames["method"] == one["name"]]
        assert (
            sum(us >= 0 for us in one["frames"]["first_answer_us"])
            == mine["first_answer_ns"].notna().sum()
        )
    assert sum(len(one["lookups"]["t_us"]) for one in shown["methods"]) == len(run.lookups)
    assert sum(len(one["held_objects"]["car"]) for one in shown["methods"]) == len(run.held_objects)


def test_every_field_of_the_replay_is_told_where_it_is_made(page):
    def fields(value: object) -> Iterator[str]:
        if isinstance(value, dict):
            yield from value
        for part in value.values() if isinstance(value, dict) else value:
            if isinstance(part, dict | list):
                yield from fields(part)

    told = replay.__doc__.partition("::")[2]
    assert set(fields(replay_of(page) | {"parts": {}})) <= set(re.findall(r"\w+", told))


def test_a_frame_of_the_replay_is_that_of_the_tables(run, page):
    shown = replay_of(page)
    genie = of_method(shown, "genie")
    for stream in shown["streams"][::5]:
        frame_id = stream["first_id"] + 7
        row = run.frames.query(
            f"method == 'genie' and car == '{stream['car']}' and stream == '{stream['stream']}' and"
            " frame == 7"
        ).iloc[0]
        told = {name: column[frame_id] for name, column in genie["frames"].items()}
        assert shown["names"][told["source"]] == row["source"]
        assert told["received_ns"] == row["received_ns"] - row["stamp_ns"]
        assert {told[name] for name in told if name.startswith("bytes")} == {
            row[name] for name in row.index if name.startswith("bytes")
        }
        hits = [i for i, of in enumerate(genie["lookups"]["frame_id"]) if of == frame_id]
        mine = run.lookups.query(f"car == '{stream['car']}' and stream == '{stream['stream']}'")
        assert len(hits) == (mine["stamp_ns"] == row["stamp_ns"]).sum() > 0


def test_the_steps_of_every_frame_add_up_to_its_response_time(run, page):
    shown = replay_of(page)
    for one in shown["methods"]:
        steps, frames = one["steps"], run.frames[run.frames["method"] == one["name"]]
        sums = dict.fromkeys(("first", "fresh", "both", "result"), 0)
        for which, took_ns in zip(steps["which"], steps["took_ns"], strict=True):
            sums[shown["names"][which]] += took_ns
        for answer in ("first", "fresh"):
            whole = (frames[f"{answer}_answer_ns"] - frames["received_ns"]).sum()
            assert sums[answer] + sums["both"] == whole > 0
        assert set(steps["frame_id"]) <= set(
            range(sum(len(stream["stamp_us"]) for stream in shown["streams"]))
        )


def test_the_replay_has_cars_and_what_they_hold_where_the_tables_have_them(run, page):
    shown = replay_of(page)
    held = of_method(shown, "genie")["held_objects"]
    rows, poses = run.held_objects.query("method == 'genie'"), run.poses
    for axis in ("east", "north"):
        assert sorted(held[f"{axis}_cm"]) == pytest.approx(100 * np.sort(rows[f"{axis}_m"]), abs=1)
        driven = [np.cumsum(stream[f"{axis}_cm"]) for stream in shown["streams"]]
        drives = 100 * np.sort(poses[f"{axis}_m"])
        assert np.sort(np.concatenate(driven)) == pytest.approx(drives, abs=1)


def of_method(shown: dict, name: str) -> dict:
    return next(one for one in shown["methods"] if one["name"] == name)


def test_page_and_terminal_tell_one_simulated_time(run, page):
    """That of the last frame; the replay goes on until the last instant on record."""
    assert screen.header(run) in page
    last = [run.frames[name].max() for name in ("stamp_ns", "first_answer_ns", "fresh_answer_ns")]
    assert replay_of(page)["end_us"] == max(*last, run.lookups["t_ns"].max()) // 1000


def test_no_script_knows_a_method_by_name():
    for script in Path(pages.__file__).parent.glob("*.js"):
        assert not re.search(
            r"""["'`](local|remote|genie)["'`]|\.(local|remote)\b""", script.read_text()
        ), script.name


@pytest.mark.slow
def test_the_page_has_the_numbers_sentences_and_figures_of_the_run(run, page):
    """Each figure once, the same as in the folder of figures."""
    words = unescape(re.sub("<[^>]*>", "", page))
    assert all(sentence in words for sentence in verdicts(compare([run])))
    mean = run.metrics.query("metric == 'first_answer_mean' and method == 'genie'")["value"].item()
    assert f"<td>{mean:.3g} <small>" in page
    assert run.yaml.strip() in words
    pictures = [base64.b64decode(text) for text in re.findall(r'svg\+xml;base64,([^"]*)', page)]
    drawn = figures.of_run(run)
    assert pictures == [
        figures.svg(drawn[name]) for name, pages in style.RUN_FIGURES.items() if style.RUN in pages
    ]


def test_the_page_is_small(page):
    assert len(page.encode()) < 0.5 * MEGABYTE


def test_a_long_run_is_cut_honestly(run, monkeypatch):
    """A stretch is shown whole, the page says which, and everything else still covers the whole
    run.
    """
    whole = pages.of_run(run, {})
    monkeypatch.setattr(replay, "MAX_ROWS", 1500)
    cut = pages.of_run(run, {})
    kept = replay_of(cut)
    count = sum(len(stream["stamp_us"]) for stream in kept["streams"])
    assert 0 < count < len(run.poses)
    assert kept["end_us"] == 1_000_000
    assert count == (run.poses["stamp_ns"] < NS).sum()
    assert "from 0.0 s to 1.0 s of 2." in cut and "every frame from" not in whole
    before, after = (one.partition("<footer>")[0] for one in (whole, cut))
    assert before == after


def test_a_later_stretch_holds_what_was_held_before_it(run, monkeypatch):
    monkeypatch.setattr(replay, "MAX_ROWS", 1000)
    later = replay_of(pages.of_run(run, {}, NS))
    assert later["begin_us"] == 1_000_000
    held = run.held_objects.query("method == 'genie'")
    known = held[(held["begin_ns"] <= later["end_us"] * 1000) & ~(held["end_ns"] <= NS)]
    assert len(of_method(later, "genie")["held_objects"]["car"]) == len(known) > 5


def test_the_first_frame_of_a_lap_is_told_however_far_frames_are_apart():
    """Frames 1 s apart are of one lap, and those of two laps may follow without a pause."""
    camera = {"name": "front", "recording": "02", "rate": "1 Hz"}
    twice = {"cars[0].route.laps": 2, "cars[0].route.pause": "0 s"}
    seldom = {"cameras": [camera], "methods": ["local"]}
    run = short_run("street_1car_hetero", 1, 3.0, **twice, **seldom)
    (stream,) = replay.replay_data(run, 0)[0]["streams"]
    is_far = np.diff(np.cumsum(stream["stamp_us+"])) > 900_000
    assert is_far.tolist() == [True, True, True, False, True, True, True]
    assert stream["lap_ids"] == [4]


def test_the_last_frame_is_shown_where_nothing_happens_after_it(run):
    frames, lookups = run.tables["frames"], run.tables["lookups"]
    answers = ("first_answer_ns", "result_answer_ns", "fresh_answer_ns")
    frames = frames.assign(**dict.fromkeys(answers, frames["stamp_ns"]))
    quiet = replace(run, tables={**run.tables, "frames": frames, "lookups": lookups.rows([])})
    shown, note = replay.replay_data(quiet, 0)
    count = sum(len(stream["stamp_us+"]) for stream in shown["streams"])
    assert count == len(run.poses) and not note
    assert replay.replay_data(quiet, 1000 * NS)[0]["streams"], "a start beyond the end"


def test_a_later_start_of_a_run_that_fits_is_not_called_too_large(run, monkeypatch):
    _, before = replay.replay_data(run, NS)
    monkeypatch.setattr(replay, "MAX_ROWS", 1500)
    _, after = replay.replay_data(run, NS)
    assert "too large" not in before and "too large" in after


def without_poses(run: gs.Run) -> gs.Run:
    return replace(run, tables={**run.tables, "poses": run.tables["poses"].rows([])})


def test_a_run_without_poses_says_so(run):
    told = pages.of_run(without_poses(run), {})
    assert "There is no replay" in told and 'id="map"' not in told


EVERY_FRAME_NEW = {
    "genie.similarity": "exact",
    "genie.eviction": "lru",
    "genie.capacity": "10 entries",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "share"), [pytest.param({}, 3, marks=pytest.mark.nightly), (EVERY_FRAME_NEW, 4)]
)
def test_two_minutes_of_three_cars_stay_below_3_megabytes(settings, share, monkeypatch):
    """A quarter of them: with a third of the rows that are ever shown a usual run is shown whole,
    with a quarter one whose every frame is answered by a detector is cut.
    """
    monkeypatch.setattr(replay, "MAX_ROWS", replay.MAX_ROWS // share)
    laps = {f"cars[{i}].route.laps": 3 for i in range(3)}
    run = gs.run("street_3car_hetero", {**laps, **settings})
    assert run.poses["stamp_ns"].max() > 29 * NS
    page = pages.of_run(run, {})
    assert ("every frame from" in page) == (settings == EVERY_FRAME_NEW)
    bare = len(pages.of_run(without_poses(run), {}).encode())
    replayed = len(page.encode()) - bare
    assert bare + 4 * replayed < 2.5 * MEGABYTE, "figures take up to 0.5 MB"


# The command


@pytest.mark.slow
def test_run_writes_the_page_unless_told_not_to(capsys):
    short = ["--set", "cars[0].route.window=[0 s, 1 s]", "--set", "methods=[genie]"]
    assert main(["run", "street_1car_homo", *short, "--out", "with"]) == 0
    assert main(["run", "street_1car_homo", *short, "--out", "without", "--no-report"]) == 0
    (made,), (bare,) = Path("with").iterdir(), Path("without").iterdir()
    assert (made / "report.html").is_file()
    assert not (bare / "report.html").exists()
    assert f"{made / 'report.html'}" in capsys.readouterr().out
    assert main(["report", str(bare)]) == 0
    assert (bare / "report.html").read_bytes() == (made / "report.html").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: not a result folder: it does not exist"),
        (["nowhere", "--start", "3 parsec"], "--start: "),
    ],
)
def test_a_report_of_nothing_gets_one_line(arguments, message, capsys):
    assert main(["report", *arguments]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_page_that_cannot_be_written_is_named():
    with pytest.raises(gs.UserError, match=r"no/such/folder/r\.html: cannot be written"):
        template.write(Path("no/such/folder/r.html"), "")


# Names are what users write


def evil_run(run: gs.Run) -> gs.Run:
    """The same run, with markup in the place of every name that a user may choose."""
    facts = copy.deepcopy(dict(run.facts))
    facts["scenario"] |= {"name": EVIL, "description": EVIL, "model": EVIL}
    facts["scenario"]["cars"][0]["name"] = facts["scenario"]["edges"][0]["name"] = EVIL
    tables = dict(run.tables)
    for name in ("frames", "lookups", "poses"):
        for column in ("car", "stream", "served_by", "genie"):
            if column in tables[name].names:
                text = tables[name][column]
                evil = [one.replace("car1", EVIL).replace("camera_02", EVIL) for one in text.names]
                tables[name] = tables[name].assign(**{column: Text.of(text.codes, evil)})
    return replace(run, facts=facts, yaml=EVIL, tables=tables)


def test_no_name_ends_the_data_or_becomes_markup(run):
    page = pages.of_run(evil_run(run), {})
    assert page.count("<script") == 2
    assert "<img" not in page
    assert page.count(escape(EVIL)) >= 4


# In a browser


@pytest.fixture
def file(page: str, tmp_path: Path) -> Path:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


def text_of(browser: Browser) -> str:
    return browser.evaluate("document.body.innerText")


def pixels(browser: Browser, canvas: str) -> int:
    """How many different colours a canvas shows."""
    return browser.evaluate(
        f"new Set(new Uint32Array(byId('{canvas}').getContext('2d')"
        f".getImageData(0, 0, byId('{canvas}').width, byId('{canvas}').height).data.buffer)).size"
    )


def rectangle(browser: Browser, element: str) -> list[float]:
    """Left, top, right and bottom of an element in the window."""
    return browser.evaluate(
        "(({ left, top, right, bottom }) => [left, top, right, bottom])"
        f"(byId('{element}').getBoundingClientRect())"
    )


@pytest.mark.parametrize(
    ("width", "dark"),
    [(1200, False), (1200, True), (700, False), (360, False)],
    ids=["wide", "dark", "half", "narrow"],
)
def test_the_page_draws_itself_in_any_window(browser, file, width, dark):
    browser.size(width, 900, dark=dark)
    browser.open(file)
    assert browser.errors == []
    assert asked_for(browser) == [file.as_uri()]
    assert pixels(browser, "map") > 100
    assert pixels(browser, "strip") > 5
    shown = picture(browser.screenshot())
    assert shown.std() > 10
    assert (shown.mean() < 80) == dark
    assert browser.evaluate("document.documentElement.scrollWidth") == width
    decoded = (
        "Promise.all([...document.images].map(one => one.decode().then(() => one.naturalWidth)))"
    )
    assert min(browser.evaluate(decoded)) > 100


def test_the_page_of_a_town_says_how_much_of_the_answers_was_not_there(browser, tmp_path):
    in_town = gs.run("fleet_30", {"fleet.cars": 3, "perception.duration": "2 s"})
    browser.open(in_town.report(tmp_path / "r.html"))
    assert browser.errors == []
    ghosts = in_town.metrics.query("metric == 'ghost_share' and method == 'genie'")["value"].item()
    assert re.search(rf"false objects \[%\].*{100 * ghosts:.3g}", text_of(browser))
    assert browser.evaluate("document.querySelector('canvas')") is None, "there is no one street"


def test_the_page_of_a_run_that_recorded_frames_alone(browser, tmp_path):
    settings = {"fleet.cars": 3, "perception.duration": "1 s", "methods": ["genie"], "record": []}
    browser.open(gs.run("fleet_30", settings).report(tmp_path / "r.html"))
    assert browser.errors == []
    assert browser.evaluate("document.images.length") == 1, "response times alone"


def test_the_page_of_three_cars_is_short_and_its_folds_open(browser, file):
    browser.size(1400, 900)
    browser.open(file)
    assert browser.evaluate("document.documentElement.scrollHeight") <= 4000
    browser.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert browser.evaluate("document.querySelector('pre').clientHeight") > 100
    browser.size(420, 800)
    browser.open(file)
    spare = (
        "((box) => box.clientWidth - box.firstChild.offsetWidth)(document.querySelector('.scroll'))"
    )
    assert browser.evaluate(spare) >= 0, "every method's column is in the window of a telephone"
    assert browser.errors == []


def test_the_slider_moves_the_street_by_mouse_and_by_key(browser, file):
    browser.open(file)
    before, picture_before = (
        browser.evaluate("byId('clock').value"),
        browser.evaluate("byId('map').toDataURL()"),
    )
    browser.evaluate("byId('time').focus()")
    for _ in range(20):
        browser.press("ArrowRight")
    after = browser.evaluate("byId('clock').value")
    assert float(after.split(" s")[0]) == pytest.approx(
        float(before.split(" s")[0]) + 0.2, abs=0.011
    )
    assert browser.evaluate("byId('map').toDataURL()") != picture_before
    browser.click(*middle(browser, "time"))
    now, end = re.fullmatch(
        r"([\d.]+) s of ([\d.]+) s", browser.evaluate("byId('clock').value")
    ).groups()
    assert float(now) == pytest.approx(float(end) / 2, abs=0.03)


def test_play_lets_time_run_and_pause_stops_it(browser, file):
    browser.open(file)
    browser.evaluate("byId('time').value = 0; byId('time').dispatchEvent(new Event('input'))")
    browser.click(*middle(browser, "play"))
    assert browser.evaluate("byId('play').textContent") == "Pause"
    browser.evaluate("new Promise(done => setTimeout(done, 600))")
    browser.click(*middle(browser, "play"))
    stopped = browser.evaluate("byId('time').value")
    assert int(stopped) > 0
    browser.evaluate("new Promise(done => setTimeout(done, 200))")
    assert browser.evaluate("byId('time').value") == stopped


def test_a_false_object_is_a_cross_on_the_street_and_counted_below_it(browser, file, run):
    browser.open(file)
    browser.evaluate("for (const id of ['trail', 'views']) byId(id).click()")
    # later there are more of them, and on a larger street they do not lie on one another
    browser.evaluate("byId('map').style.height = '60rem'")
    browser.evaluate("byId('time').value = 195; byId('time').dispatchEvent(new Event('input'))")
    told = browser.evaluate("""unpacked(byId('data').textContent).then((replay) => {
      const run = decode(replay), map = byId('map');
      const t = Number(byId('clock').value.split(' ')[0]) * 1e6;
      const found = heldObjectsAt(run.methods[Number(byId('method').value)], t);
      const { place } = viewOf(run, map.clientWidth, map.clientHeight), pen = map.getContext('2d');
      const pixel = ({ east_m, north_m }) => place(east_m, north_m).map(Math.round);
      const at = (object) => pen.getImageData(...pixel(object), 1, 1).data.slice(0, 3);
      const digits = (part) => part.toString(16).padStart(2, '0');
      const hex = (point) => '#' + [...point].map(digits).join('');
      const tones = (of) => {
        const tone = found.filter(of).map((one) => hex(at(one)));
        return [tone.filter((one) => one === colour('false')).length, tone.length];
      };
      const there = [tones(isFalse), tones((one) => one.judged === 'right')];
      byId('held-objects').click();
      return [...there, tones(isFalse), byId('moment').textContent];
    })""")
    (crosses, false_ones), (wrong, right), (hidden, _), text = told
    assert crosses > 0.8 * false_ones > 3, "a car may stand on one, and the outer ones are outside"
    assert wrong < right, "a false object may lie on what is there"
    assert hidden == 0
    t_ns = 1.95 * NS
    rows = run.held_objects.query("method == 'genie'")
    rows = rows[(rows.begin_ns <= t_ns) & ~(rows.end_ns <= t_ns)]
    objects = rows.drop_duplicates(["car", "label", "east_m", "north_m", "judged"])
    assert len(objects) < len(rows), "several cameras see them"
    judged = objects["judged"].value_counts()
    counts = judged.get("right", 0), false_ones, judged.get("missed", 0)
    assert tuple(map(int, re.findall(r"\d+", text)[2:])) == counts
    assert judged.sum() == sum(counts)


def test_a_click_on_a_frame_tells_its_story_from_the_stamp_on(browser, file, run):
    browser.open(file)
    x, y = middle(browser, "strip")
    browser.click(x, y)
    title = browser.evaluate("byId('story').querySelector('h3').textContent")
    assert title.startswith(
        browser.evaluate("byId('frame-told').textContent").partition(", Genie")[0]
    )
    car, stream, frame = re.match(r"(\w+), (\w+), frame (\d+)", title).groups()
    genie = run.frames[run.frames["method"] == "genie"]
    (row,) = genie.query(f"car == '{car}' and stream == '{stream}' and frame == {frame}").to_dict(
        "records"
    )
    story = browser.evaluate("byId('story').textContent")
    assert f"{car}/genie looks into its message cache" in story
    took_ms = (row["first_answer_ns"] - row["stamp_ns"]) / 1e6
    assert f"served by {row['served_by']}, {took_ms:.1f} ms after the picture" in story
    if pd.notna(row["objects_fresh"]):
        assert f"{int(row['objects_fresh'])} object" in story
    assert "dropped at" in story or "fresh result" in story.lower()
    parts, told = browser.evaluate("""unpacked(byId('data').textContent).then((replay) => {
      const run = decode(replay), method = { ...run.methods[0], cars: [] };
      return [storyOf(run, method, 0).length, shortStory(run, method, 0)];
    })""")
    assert parts == 1 and told.endswith(": the car does not drive under this method.")
    steps = browser.evaluate(
        "[...byId('story').querySelectorAll('tbody tr')].map((row) => [...row.cells]"
        ".map((cell) => cell.textContent))"
    )
    last = "fresh" if pd.notna(row["fresh_answer_ns"]) else "first"
    whole_ms = (row[f"{last}_answer_ns"] - row["stamp_ns"]) / 1e6
    assert steps[-1] == ["all", "", "", f"{whole_ms:.6f} ms"]
    received_ms = (row["received_ns"] - row["stamp_ns"]) / 1e6
    assert [at for _, _, at, _ in steps[:2]] == ["0.000000 ms", f"{received_ms:.6f} ms"]


def test_what_is_clicked_in_the_strip_stays_under_the_pointer(browser, tmp_path):
    """Of a run that is longer than the strip is wide: neither the page nor the strip's stretch of
    time moves.
    """
    run = short_run("street_3car_hetero", 3, 9.0)
    browser.size(420, 800)
    browser.open(run.report(tmp_path / "r.html"))
    x, y = middle(browser, "strip")
    place = "[scrollY, byId('strip').getBoundingClientRect().top]"
    before = browser.evaluate(place)
    for aside in (-100, 60, 110):
        browser.click(x + aside, y)
        told = browser.evaluate("byId('frame-told').textContent")
        browser.click(x + aside, y)
        assert browser.evaluate("byId('frame-told').textContent") == told
        assert browser.evaluate(place) == before


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (420, 800)])
def test_the_strip_stays_in_the_window_beside_the_story(browser, file, width, height):
    browser.size(width, height)
    browser.open(file)
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    browser.evaluate("byId('frame').scrollIntoView()")
    left, top, right, bottom = rectangle(browser, "strip")
    assert 0 < top < bottom < height
    told, at = (browser.evaluate(one) for one in ("byId('frame-told').textContent", "scrollY"))
    browser.click((left + right) / 2 + 20, top + 8)
    assert browser.evaluate("byId('frame-told').textContent") != told
    assert browser.evaluate("scrollY") == at
    hidden = (
        "byId('h-frame').getBoundingClientRect().top -"
        " byId('frames').getBoundingClientRect().bottom"
    )
    assert browser.evaluate(hidden) > 0, "the strip does not cover the heading"


@pytest.mark.parametrize(("width", "height"), [(1366, 700), (420, 700)])
def test_play_is_in_the_window_wherever_the_street_is(browser, file, width, height):
    browser.size(width, height)
    browser.open(file)
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    for element in ("map", "legend"):
        browser.evaluate(f"byId('{element}').scrollIntoView({{block: 'center'}})")
        left, top, right, bottom = rectangle(browser, "play")
        assert 0 < top < bottom < height
        above = f"document.elementFromPoint({(left + right) / 2}, {(top + bottom) / 2}).id"
        assert browser.evaluate(above) == "play", "nothing covers it"


def test_an_address_leads_to_an_instant_and_a_method(browser, file):
    browser.open(file)
    browser.evaluate("byId('method').value = 0; byId('method').dispatchEvent(new Event('change'))")
    browser.evaluate("byId('time').value = 123; byId('time').dispatchEvent(new Event('input'))")
    browser.evaluate("new Promise(done => setTimeout(done, 400))")  # it follows the last change
    assert browser.evaluate("location.hash") == "#t=1.230&method=local"
    state = "[byId('clock').value, byId('method').value]"
    for address, clock, method in (
        ("#t=0.5&method=remote", "0.50 s", "1"),
        ("#t=1.25&method=unknown", "1.25 s", "1"),
        ("#t=99&method=%zz", "2.", "1"),
        ("#t=x", "2.", "1"),
    ):
        browser.evaluate(
            f"new Promise(done => {{ location.hash = '{address}'; setTimeout(done, 100) }})"
        )
        told = browser.evaluate(state)
        assert told[0].startswith(clock) and told[1] == method, address
    elsewhere = file.with_name("elsewhere.html")
    elsewhere.write_text("<title>elsewhere</title>")
    browser.open(elsewhere)
    browser.open(file, "#t=0.75&method=remote")
    assert browser.evaluate(state) == [browser.evaluate("byId('clock').value"), "1"]
    assert browser.evaluate("byId('clock').value").startswith("0.75 s")
    assert 0 < rectangle(browser, "play")[1] < 200, "the page begins at the replay"
    assert browser.errors == []


def test_messages_travel_on_the_links_that_the_steps_name(browser, file, run):
    """Each once, even if it is on the way of both answers to a frame."""
    browser.open(file)
    steps = run.steps[run.steps["place"].str.contains("->") & (run.steps["part"] != "queueing")]
    for method in run.methods:
        rows = steps[steps["method"] == method.name]
        keys = ["car", "stream", "stamp_ns", "place", "begin_ns"]
        expected = rows.drop_duplicates(keys).sort_values("begin_ns")
        shown = browser.evaluate(
            "unpacked(byId('data').textContent).then((replay) => decode(replay).methods"
            f".find((method) => method.name === '{method.name}').messages.all"
            ".map((message) => [message.from, message.to, message.begin_us, message.end_us]))"
        )
        assert len(shown) == len(expected)
        for column, place in (("begin_ns", 2), ("end_ns", 3)):
            times_us = sorted(message[place] for message in shown)
            assert times_us == pytest.approx(sorted(expected[column] / 1000), abs=3)
        assert sorted(f"{a}->{b}" for a, b, *_ in shown) == sorted(expected["place"])


def test_after_a_hand_over_a_car_is_linked_to_its_new_edge(browser, tmp_path):
    hand_over = {"fault": "hand_over", "target": "car1", "begin": "0.5 s", "edge": "edge2"}
    run = short_run("street_2car_hetero", 2, 1.0, methods=["genie"], faults=[hand_over])
    browser.open(run.report(tmp_path / "r.html"))
    assert browser.errors == []
    linked = (
        "unpacked(byId('data').textContent).then((replay) => decode(replay).cars"
        ".map((car) => [0, 549e3, 550e3].map((t) => edgeAt(car, t))))"
    )
    assert browser.evaluate(linked) == [["edge1", "edge1", "edge2"], ["edge2"] * 3]


def test_keys_move_the_time_change_the_method_and_play(browser, file):
    browser.open(file)
    browser.evaluate("byId('map').focus()")
    before = int(browser.evaluate("byId('time').value"))
    browser.press("ArrowRight")
    assert int(browser.evaluate("byId('time').value")) == before + 10
    browser.press("ArrowLeft")
    browser.press("ArrowUp")
    assert browser.evaluate("byId('method').selectedOptions[0].text") == "remote (R)"
    title = browser.evaluate("byId('story').querySelector('h3').textContent")
    assert "under" in title and "remote (R)" in title
    browser.press("ArrowDown")
    for word in ("Pause", "Play"):
        browser.press(" ")
        assert browser.evaluate("byId('play').textContent") == word
    browser.evaluate("byId('strip').focus()")
    browser.press(" ")
    assert browser.evaluate("byId('play').textContent") == "Pause"
    browser.open(file)
    browser.evaluate(
        "window.asked = []; window.requestAnimationFrame = (tick) => asked.push(tick);"
        " window.cancelAnimationFrame = (place) => { delete asked[place - 1] };"
        " for (let press = 0; press < 5; press++) byId('play').click()"
    )
    assert browser.evaluate("Object.keys(asked).length") == 1, "or it plays faster"


def test_every_control_and_canvas_has_a_name(browser, file):
    browser.open(file)
    unnamed = browser.evaluate(
        "[...document.querySelectorAll('button, select, input, canvas,"
        " [tabindex]:not(main)')].filter(one => !(one.labels?.length ||"
        " one.getAttribute('aria-label') || one.textContent.trim())).map(one => one.outerHTML)"
    )
    assert unnamed == []


def test_frames_are_chosen_by_keys_and_by_number(browser, file):
    browser.open(file)
    browser.evaluate(
        "byId('which-stream').value = 1; byId('which-stream').dispatchEvent(new Event('change'))"
    )
    browser.evaluate("byId('strip').focus()")
    number = int(browser.evaluate("byId('which-frame').value"))
    browser.press("ArrowRight")
    assert int(browser.evaluate("byId('which-frame').value")) == number + 1
    browser.press("ArrowDown")
    assert int(browser.evaluate("byId('which-stream').value")) == 2
    for typed in (99999, 99999, 1.5, -7, -7):
        browser.evaluate(f"byId('which-frame').value = {typed}")
        browser.evaluate("byId('which-frame').dispatchEvent(new Event('change'))")
        shown = int(browser.evaluate("byId('which-frame').value"))
        assert 0 <= shown < 99999 and (shown == 1 or typed != 1.5)
        assert f"frame {shown}, under" in browser.evaluate("byId('story').textContent")
    assert browser.errors == []


def test_a_click_on_the_street_chooses_the_nearest_car(browser, file):
    browser.open(file)
    browser.click(*middle(browser, "map"))
    assert re.match(
        r"car\d, camera_\d\d, frame \d+", browser.evaluate("byId('frame-told').textContent")
    )
    assert browser.errors == []


def test_a_car_without_cameras_asks_with_its_position(browser, tmp_path):
    run = short_run("street_case_study", 2, 1.0)
    browser.open(run.report(tmp_path / "r.html"))
    for stream, begin in (
        (0, "car1 takes the picture"),
        (4, "car2, without cameras, asks with its position"),
    ):
        browser.evaluate(f"byId('which-stream').value = {stream}")
        browser.evaluate("byId('which-stream').dispatchEvent(new Event('change'))")
        assert begin in browser.evaluate("byId('story').textContent")
    points = []  # that are painted in the second row of its frames
    for method in ("genie", "local"):
        place = [info.name for info in run.methods].index(method)
        browser.evaluate(f"byId('method').value = {place}")
        browser.evaluate("byId('method').dispatchEvent(new Event('change'))")
        row = "byId('strip').getContext('2d').getImageData(115, 16, 1000, 13).data"
        points.append(browser.evaluate(f"{row}.filter((value, i) => i % 4 === 3 && value).length"))
    assert "does not drive" in browser.evaluate("byId('story').textContent")
    assert points[1] < points[0] / 2, "it has no cells"


@pytest.mark.parametrize(
    ("scenario", "cars", "settings"),
    [
        ("street_case_study", 2, {}),
        ("street_1car_homo", 1, {"methods": ["local"]}),
        ("street_1car_homo", 1, {"methods": ["remote", "local"]}),
        (
            "street_1car_homo",
            1,
            {"cars[0].edge": None, "cars[0].link": None, "edges": [], "methods": ["genie"]},
        ),
        ("street_2car_homo", 2, {"genie.algorithm": "literal"}),
        (
            "street_2car_homo",
            2,
            {
                "genie.object_map.threshold": {"percentile": 60},
                "cameras": [{"name": "one", "recording": "02"}],
            },
        ),
    ],
    ids=["a car without cameras", "local alone", "no Genie", "no edge", "literal", "one camera"],
)
def test_every_kind_of_run_has_its_page(browser, tmp_path, scenario, cars, settings):
    run = short_run(scenario, cars, 1.0, **settings)
    browser.open(run.report(tmp_path / "r.html"))
    assert browser.errors == []
    assert browser.evaluate("byId('story').querySelector('h3').textContent").startswith("car")
    assert "Infinity" not in browser.evaluate("document.body.innerText")
    assert "NaN" not in browser.evaluate("document.body.innerText")
    assert "undefined" not in browser.evaluate("document.body.innerText")
    alone = len(run.methods) == 1
    assert browser.evaluate("byId('method').parentElement.hidden") == alone
    legend = browser.evaluate("byId('legend').innerText")
    shown = run.methods[int(browser.evaluate("byId('method').value"))].name
    assert shown != "local" or "message to an edge" not in legend
    assert run.facts["scenario"]["edges"] or "look-up at an edge" not in legend


def test_markup_in_names_is_shown_as_text(browser, tmp_path, run):
    browser.open(evil_run(run).report(tmp_path / "r.html"))
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.evaluate("byId('name').textContent") == EVIL
    assert browser.evaluate("document.title").startswith(EVIL.split("\u2028")[0])
    assert browser.errors == []
    assert asked_for(browser) == [(tmp_path / "r.html").as_uri()]


def test_whoever_wants_less_motion_gets_none(browser, file):
    browser.size(1200, 900, calm=True)
    browser.open(file)
    first = browser.evaluate("byId('clock').value")
    browser.evaluate("new Promise(done => setTimeout(done, 300))")
    assert browser.evaluate("byId('clock').value") == first
    assert browser.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
