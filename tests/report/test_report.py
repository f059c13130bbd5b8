"""The report of a run: one page, offline, safe, the same bytes each time; and what its reader does
with it.
"""

from __future__ import annotations

import copy
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import genie_sim as gs
from genie_sim.analysis import screen
from genie_sim.analysis.registry import METRICS
from genie_sim.base.classes import SIZES
from genie_sim.base.text import number_text
from genie_sim.cli.main import main
from genie_sim.record.columns import Text
from genie_sim.report import data, html_page, replay
from tests.browser import Browser
from tests.report.pages import EVIL, MEGABYTE, embedded, middle, picture

NS = 1_000_000_000


def short_run(
    scenario: str = "street_3car_hetero", cars: int = 3, seconds: float = 2.0, **settings: object
) -> gs.Run:
    windows = {f"cars[{i}].route.window": ["0 s", f"{seconds} s"] for i in range(cars)}
    return gs.run(scenario, windows | settings)


@pytest.fixture(scope="module")
def run() -> gs.Run:
    return short_run()


@pytest.fixture(scope="module")
def page(run: gs.Run) -> str:
    return html_page.page(run)


# What the page holds


def test_the_page_names_no_other_address(page):
    """Neither the page nor its script asks for anything; its policy forbids it besides."""
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) <= {"http://www.w3.org/2000/svg"}
    assert not re.findall(r"\ssrc=|@import|url\(", page)
    assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', page))
    assert "default-src 'none'" in page


def test_the_same_run_gives_the_same_page_without_any_clock(run, page):
    assert html_page.page(run) == page
    assert "wall_time" not in page


def test_every_frame_of_a_short_run_is_in_the_replay(run, page):
    shown = embedded(page)["replay"]
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
    assert sum(len(changes[4]) for one in shown["methods"] for changes in one["objects"]) == len(
        run.objects
    )


def test_a_frame_of_the_replay_is_that_of_the_tables(run, page):
    shown = embedded(page)["replay"]
    genie = of_method(shown, "genie")
    for stream in shown["streams"][::5]:
        frame_id = stream["first_id"] + 7
        row = run.frames.query(
            f"method == 'genie' and car == '{stream['car']}' and stream == '{stream['stream']}' and"
            " frame == 7"
        ).iloc[0]
        told = {name: column[frame_id] for name, column in genie["frames"].items()}
        assert shown["names"][told["source"]] == row["source"]
        assert told["received_us"] == (row["received_ns"] - row["stamp_ns"]) // 1000
        assert told["bytes_up"] == row["bytes_up"]
        hits = [i for i, of in enumerate(genie["lookups"]["frame_id"]) if of == frame_id]
        mine = run.lookups.query(f"car == '{stream['car']}' and stream == '{stream['stream']}'")
        assert len(hits) == (mine["stamp_ns"] == row["stamp_ns"]).sum() > 0


def test_the_steps_of_every_frame_add_up_to_its_response_time(run, page):
    shown = embedded(page)["replay"]
    for one in shown["methods"]:
        steps, frames = one["steps"], run.frames[run.frames["method"] == one["name"]]
        sums = dict.fromkeys(("first", "fresh", "both", "result"), 0)
        for which, took_ns in zip(steps["which"], steps["took_ns"], strict=True):
            sums[shown["whichs"][which]] += took_ns
        for answer in ("first", "fresh"):
            whole = (frames[f"{answer}_answer_ns"] - frames["received_ns"]).sum()
            assert sums[answer] + sums["both"] == whole > 0
        assert set(steps["frame_id"]) <= set(
            range(sum(len(stream["stamp_us"]) for stream in shown["streams"]))
        )


def test_ghosts_that_a_car_holds_are_those_of_the_table(run, page):
    for one in embedded(page)["replay"]["methods"]:
        mine = run.held[(run.held["method"] == one["name"]) & (run.held["what"] == "consumer")]
        assert {car: sum(of["right"]) for car, of in one["held"].items()} == {
            str(car): rows["right"].sum() for car, rows in mine.groupby("car", observed=True)
        }


def test_ghosts_on_the_street_are_as_many_as_the_page_counts(run, page):
    shown = embedded(page)["replay"]
    ghosts = [shown["judged"].index(name) for name in ("moved_away", "never_there", "duplicate")]
    for one in shown["methods"]:
        objects, seen = one["held_objects"], 0
        begins = np.cumsum(objects["begin_us"])
        took_us = np.array(objects["took_us"])
        for car, counts in one["held"].items():
            mine = np.isin(objects["judged"], ghosts) & (
                np.array(objects["car"]) == shown["names"].index(car)
            )
            for t_us, held, right in zip(
                np.cumsum(counts["t_us"]), counts["held"], counts["right"], strict=True
            ):
                is_open = (begins <= t_us) & ((took_us < 0) | (t_us < begins + took_us))
                assert (mine & is_open).sum() == held - right
                seen += held - right
        assert seen > 0


def of_method(shown: dict, name: str) -> dict:
    return next(one for one in shown["methods"] if one["name"] == name)


def test_page_and_terminal_tell_one_simulated_time(run, page):
    """That of the last frame; the replay goes on until the last instant on record."""
    shown = embedded(page)
    assert f"{number_text(shown['about']['seconds'])} s simulated" in screen.header(run)
    last = [run.frames[name].max() for name in ("stamp_ns", "first_answer_ns", "fresh_answer_ns")]
    assert (
        shown["replay"]["end_us"]
        == max(*last, run.lookups["t_ns"].max(), run.objects["t_ns"].max()) // 1000
    )


def test_the_page_lists_the_methods_that_ran_in_their_order():
    run = short_run("street_1car_homo", 1, 1.0, methods=["genie", "local"])
    assert [one["name"] for one in embedded(html_page.page(run))["methods"]] == ["genie", "local"]
    for script in Path(html_page.__file__).parent.glob("*.js"):
        assert not re.search(
            r"""["'`](local|remote|genie)["'`]|\.(local|remote)\b""", script.read_text()
        ), script.name


def test_a_curve_ends_at_the_share_that_was_answered(run, page):
    for curve in embedded(page)["cdf"]:
        mine = run.frames[run.frames["method"] == curve["method"]]
        answered = mine[f"{curve['answer']}_answer_ns"].notna().sum()
        assert (curve["rank"][-1], curve["published"]) == (answered, len(mine))
        assert len(curve["ms"]) <= data.POINTS_PER_CURVE


def test_a_long_run_is_cut_honestly(run, monkeypatch):
    """A stretch is shown whole, the page says which, and everything else still covers the whole
    run.
    """
    whole = embedded(html_page.page(run))
    monkeypatch.setattr(replay, "MAX_ROWS", 1500)
    cut = embedded(html_page.page(run))
    kept = cut["replay"]
    count = sum(len(stream["stamp_us"]) for stream in kept["streams"])
    assert 0 < count < len(run.poses)
    assert kept["end_us"] == 1_000_000
    assert count == (run.poses["stamp_ns"] < NS).sum()
    assert "from 0.0 s to 1.0 s of 2." in " ".join(cut["notes"])
    assert not any("every frame from" in note for note in whole["notes"])
    assert {key: cut[key] for key in ("metrics", "cdf", "use", "about")} == {
        key: whole[key] for key in ("metrics", "cdf", "use", "about")
    }


def test_a_later_stretch_begins_with_the_maps_as_they_were_then(run, monkeypatch):
    monkeypatch.setattr(replay, "MAX_ROWS", 1000)
    later = embedded(html_page.page(run, start_ns=NS))["replay"]
    assert later["begin_us"] == 1_000_000
    for columns in of_method(later, "genie")["hosts"].values():
        assert columns["t_us"][0] >= 1_000_000 and max(columns["busy"]) <= 1000
    known = run.objects[run.objects["t_ns"] <= NS].groupby(
        ["genie", "label", "east_m", "north_m"], observed=True
    )
    objects = of_method(later, "genie")["objects"]
    first = {(genie, label, e, n): c[0] for genie, label, e, n, t, c in objects if t[0] == 1000}
    names = later["names"]
    for (genie, label, east_m, north_m), changes in known:
        key = (names.index(genie), names.index(label), round(100 * east_m), round(100 * north_m))
        assert first[key] == round(1000 * changes["confidence"].iloc[-1])


def test_what_a_map_forgets_is_gone_from_the_replay():
    run = short_run("street_1car_hetero", 1, **{"genie.object_map.forget_after": "200 ms"})
    shown = embedded(html_page.page(run))["replay"]
    gone = sum(confidences.count(-1) for *_, confidences in of_method(shown, "genie")["objects"])
    assert gone == run.objects["confidence"].isna().sum() > 5


def test_a_run_without_poses_says_so(run):
    told = embedded(
        html_page.page(replace(run, tables={**run.tables, "poses": run.tables["poses"].rows([])}))
    )
    assert told["replay"] is None
    assert any("no replay" in note for note in told["notes"])


@pytest.mark.slow
def test_two_minutes_of_three_cars_stay_below_8_megabytes():
    laps = {f"cars[{i}].route.laps": 12 for i in range(3)}
    run = gs.run("street_3car_hetero", laps)
    assert run.poses["stamp_ns"].max() > 120 * NS
    page = html_page.page(run)
    print(f"{len(page.encode()) / MEGABYTE:.1f} MB")
    assert len(page.encode()) < 8 * MEGABYTE
    assert not any("every frame from" in note for note in embedded(page)["notes"])


@pytest.mark.slow
def test_the_longest_replay_stays_below_8_megabytes(monkeypatch):
    """As many rows as are ever shown, of a run whose every frame is answered by a detector."""
    monkeypatch.setattr(replay, "MAX_ROWS", replay.MAX_ROWS // 4)
    settings = {f"cars[{i}].route.laps": 4 for i in range(3)} | {
        "genie.similarity": "exact",
        "genie.eviction": "lru",
    }
    page = html_page.page(gs.run("street_3car_hetero", settings | {"genie.capacity": "10 entries"}))
    shown = embedded(page)
    assert any("every frame from" in note for note in shown["notes"])
    assert 4 * len(json.dumps(shown["replay"], separators=(",", ":"))) < 7.5 * MEGABYTE


# The command


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
    for folder in (made, bare):
        assert main(["rerun", str(folder)]) == 0
    assert "report.html: identical" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: not a result folder"),
        (["nowhere", "--start", "3 parsec"], "--start: "),
    ],
)
def test_a_report_of_nothing_gets_one_line(arguments, message, capsys):
    assert main(["report", *arguments]) == 1
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_page_that_cannot_be_written_is_named(run):
    with pytest.raises(gs.UserError, match=r"no/such/folder/r\.html: cannot be written"):
        run.report("no/such/folder/r.html")


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
    page = html_page.page(evil_run(run))
    assert page.count("<script") == 2
    assert page.count("<img") == 0
    assert embedded(page)["about"]["description"] == EVIL
    assert embedded(page)["about"]["yaml"] == EVIL


# In a browser


@pytest.fixture
def file(page: str, tmp_path: Path) -> Path:
    path = tmp_path / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


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
    assert browser.requests == [file.as_uri()]
    assert pixels(browser, "map") > 100
    assert pixels(browser, "strip") > 5
    shown = picture(browser.screenshot())
    assert shown.std() > 10
    assert (shown.mean() < 80) == dark
    assert browser.evaluate("document.documentElement.scrollWidth") == width
    assert browser.evaluate("document.querySelectorAll('.chart svg path').length") > 20


def test_the_page_of_a_town_says_how_much_of_the_answers_was_not_there(browser, tmp_path):
    in_town = gs.run("fleet_30", {"fleet.cars": 3, "perception.duration": "2 s"})
    browser.open(in_town.report(tmp_path / "r.html"))
    assert browser.errors == []
    ghosts = in_town.metrics.query("metric == 'ghost_share' and method == 'genie'")["value"].item()
    assert f"{100 * ghosts:.3g} % were not there" in browser.evaluate(
        "byId('headline').textContent"
    )
    shown = browser.evaluate("byId('by-method').innerText")
    assert "Streaming F1" in shown and "False objects" in shown


def test_the_page_of_a_run_that_recorded_frames_alone_has_no_empty_table(browser, tmp_path):
    settings = {"fleet.cars": 3, "perception.duration": "1 s", "methods": ["genie"], "record": []}
    browser.open(gs.run("fleet_30", settings).report(tmp_path / "r.html"))
    assert browser.errors == []
    assert browser.evaluate("byId('by-placement').rows.length") == 0


def test_the_numbers_on_the_page_are_the_metrics(browser, file, run):
    browser.open(file)
    assert browser.evaluate("document.querySelector('.chart') === byId('accuracy')"), (
        "the first figure"
    )
    assert (
        browser.evaluate("document.querySelectorAll('#accuracy > svg path[transform]').length") == 3
    )
    assert "zero-delay detector" in browser.evaluate("byId('accuracy').textContent")
    mean = run.metrics.query("metric == 'first_answer_mean' and method == 'genie'")["value"].item()
    assert f"{mean:.3g} ms" in browser.evaluate("byId('headline').textContent")
    assert browser.evaluate("byId('metric-table').tBodies[0].rows.length") == len(run.metrics)
    browser.evaluate("byId('metric-filter').value = 'fresh GENIE'")
    browser.evaluate("byId('metric-filter').dispatchEvent(new Event('input'))")
    found = run.metrics["metric"].str.contains("fresh") & run.metrics["method"].str.contains(
        "genie"
    )
    assert browser.evaluate("byId('metric-table').tBodies[0].rows.length") == found.sum() > 0


def test_bold_is_what_is_better_than_all_others_with_intervals_apart(browser, file, run):
    browser.open(file)
    bold = browser.evaluate(
        "[...byId('by-method').tBodies[0].rows].map((row) => [row.cells[0].textContent,"
        " [...row.cells].findIndex((cell) => cell.classList.contains('best'))])"
    )
    names = {METRICS[metric].title.capitalize(): metric for metric in METRICS}
    titles = {sentence.lower(): metric for sentence, metric in names.items()}
    assert len({column for _, column in bold}) > 2, "some rows have none"
    for title, column in bold:
        metric = titles[title.lower()]
        rows = [
            one
            for method in run.methods
            for one in run.measured
            if (one.metric, one.method, one.placement, one.component)
            == (metric, method.name, "all", "")
        ]
        lower = METRICS[metric].better == "lower"
        best = -1
        for place, one in enumerate(rows):
            if one.value is None:
                continue
            ends = [(other.low, other.high) for other in rows if other is not one]
            ends = [(low, high) for low, high in ends if low is not None and high is not None]
            low, high = (one.value if end is None else end for end in (one.low, one.high))
            if ends and all(high < end[0] if lower else low > end[1] for end in ends):
                best = place + 1
        assert column == best, title


def test_the_page_of_three_cars_is_short_and_its_folds_open(browser, file):
    browser.size(1400, 900)
    browser.open(file)
    assert browser.evaluate("document.documentElement.scrollHeight") <= 4200
    drawn = "byId('lanes').getContext('2d').getImageData(0, 0, 9, 9).width * byId('lanes').width"
    browser.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    browser.evaluate("new Promise((done) => setTimeout(done, 100))")
    assert browser.evaluate(drawn) > 0, "what is folded is drawn when it opens"
    assert browser.evaluate("byId('metric-table').clientHeight") > 100
    browser.size(420, 800)
    browser.open(file)
    spare = "byId('by-method').parentElement.clientWidth - byId('by-method').offsetWidth"
    assert browser.evaluate(spare) >= 0, "every method's column is in the window of a telephone"
    assert browser.errors == []


def test_hosts_differ_in_their_marks_too(browser, file, run):
    browser.open(file)
    hosts = [entry["name"] for kind in ("cars", "edges") for entry in run.facts["scenario"][kind]]
    for chart in ("accelerator", "cpu"):
        place = ["accelerator", "cpu"].index(chart)
        marks = browser.evaluate(
            f"[...byId('use-charts').children[{place}].querySelectorAll('.keys svg')].map((key) =>"
            " [...key.querySelectorAll('path')].slice(1).map((one) => one.getAttribute('d') +"
            " one.classList[1]).join())"
        )
        assert len(set(marks)) == len(marks) == len(hosts) and all(marks)
    drawn = browser.evaluate(
        "byId('use-charts').children[0].querySelectorAll(':scope > svg path[transform]').length"
    )
    assert drawn >= 3 * len(hosts)


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


def test_a_ghost_is_a_cross_on_the_street_and_a_line_in_the_table(browser, file):
    browser.open(file)
    browser.evaluate("for (const id of ['trail', 'views']) byId(id).click()")
    # later there are more of them, and on a larger street they do not lie on one another
    browser.evaluate("byId('map').style.height = '60rem'")
    browser.evaluate("byId('time').value = 195; byId('time').dispatchEvent(new Event('input'))")
    told = browser.evaluate("""(() => {
      const run = decode(DATA.replay, ABOUT), map = byId('map');
      const t = Number(byId('clock').value.split(' ')[0]) * 1e6;
      const found = believed(run, run.methods[Number(byId('method').value)], t);
      const { place } = viewOf(run, map.clientWidth, map.clientHeight), pen = map.getContext('2d');
      const pixel = ({ east, north }) => place(east, north).map(Math.round);
      const at = (object) => pen.getImageData(...pixel(object), 1, 1).data.slice(0, 3);
      const digits = (part) => part.toString(16).padStart(2, '0');
      const hex = (point) => '#' + [...point].map(digits).join('');
      const tones = (of) => {
        const tone = found.filter(of).map((one) => hex(at(one)));
        return [tone.filter((one) => one === colour('ghost')).length, tone.length];
      };
      const there = [tones(isGhost), tones((one) => one.judged === 'right')];
      byId('believed').click();
      const rows = byId('ghost-table').tBodies[0].rows.length;
      return [...there, tones(isGhost), byId('ghosts-now').textContent, rows];
    })()""")
    (crosses, ghosts), (wrong, right), (hidden, _), text, rows = told
    assert crosses > 0.8 * ghosts > 3, "a car may stand on one, and the outer ones are outside"
    assert wrong < right, "a ghost may lie on what is there"
    assert hidden == 0
    assert text.endswith(f": {ghosts}") and rows == min(ghosts, 20)


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


def test_a_click_on_a_frame_tells_its_story(browser, file, run):
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
    assert "dropped at" in story or "fresh" in story
    last = "fresh" if pd.notna(row["fresh_answer_ns"]) else "first"
    whole_ms = (row[f"{last}_answer_ns"] - row["received_ns"]) / 1e6
    assert (
        browser.evaluate("byId('story').querySelector('tbody tr:last-child').textContent")
        == f"all{whole_ms:.6f} ms"
    )
    assert "are false" in browser.evaluate("byId('now').textContent")


def test_where_the_time_goes_is_the_mean_of_the_answers(browser, file, run):
    browser.open(file)
    rows = browser.evaluate(
        "[...byId('part-table').querySelectorAll('tbody tr')].map((row) => [row.firstChild,"
        " row.lastChild].map((cell) => cell.textContent))"
    )
    means = {
        one.metric: one.value
        for one in run.measured
        if (one.method, one.component) == ("genie", "")
    }
    told = {name: float(value.removesuffix(" ms")) for name, value in rows}
    assert told["Genie (DG), first"] == pytest.approx(means["first_answer_mean"], rel=5e-3)
    assert told["Genie (DG), fresh"] == pytest.approx(means["fresh_answer_mean"], rel=5e-3)
    bars = browser.evaluate("byId('part-bars').querySelectorAll('svg.parts').length")
    assert bars == len(rows) >= 4


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


def test_the_page_tells_what_each_car_holds_under_each_method(browser, file, run):
    """The newest answered frame of a car when the replay stands still, with its age since the
    camera's stamp.
    """
    browser.open(file)
    assert browser.evaluate("[...byId('now').tHead.rows[0].cells].map(one => one.textContent)")[
        1:
    ] == [method.title for method in run.methods]
    browser.evaluate("byId('time').value = 100; byId('time').dispatchEvent(new Event('input'))")
    now_ns = 1_000_000_000
    for row, car in enumerate(sorted(run.frames["car"].unique())):
        for column, method in enumerate(run.methods):
            mine = run.frames.query(
                f"car == '{car}' and method == '{method.name}' and first_answer_ns <= {now_ns}"
            )
            told = browser.evaluate(
                f"byId('now').tBodies[0].rows[{row}].cells[{column + 1}].textContent"
            )
            if mine.empty:
                assert told == "nothing yet"
                continue
            held = mine.sort_values("stamp_ns").iloc[-1]
            fresh = held["fresh_answer_ns"] <= now_ns
            result = held["result_answer_ns"] <= now_ns
            newest = "objects_fresh" if fresh else "objects_result" if result else "objects_served"
            objects = int(held[newest])
            age_ms = (now_ns - held["stamp_ns"]) / 1e6
            assert told.startswith(f"{objects} object")
            assert abs(float(re.search(r"(\d+) ms old", told)[1]) - age_ms) <= 1
            assert told.endswith(", fresh") == fresh


@pytest.mark.parametrize(("width", "height"), [(1366, 700), (420, 700)])
def test_play_is_in_the_window_wherever_the_two_streets_are(browser, file, width, height):
    browser.size(width, height)
    browser.open(file)
    browser.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    for element in ("street", "map", "map-b", "hosts-b", "difference"):
        browser.evaluate(f"byId('{element}').scrollIntoView({{block: 'center'}})")
        left, top, right, bottom = rectangle(browser, "play")
        assert 0 < top < bottom < height
        above = f"document.elementFromPoint({(left + right) / 2}, {(top + bottom) / 2}).id"
        assert browser.evaluate(above) == "play", "nothing covers it"


def test_two_methods_stand_side_by_side_on_one_clock(browser, file, run):
    browser.open(file)
    chosen = "['method', 'method-b'].map((id) => byId(id).selectedOptions[0].text)"
    assert browser.evaluate(chosen) == ["Genie (DG)", "remote (R)"]
    pictures = "['map', 'map-b', 'camera', 'camera-b'].map((id) => byId(id).toDataURL())"
    before = browser.evaluate(pictures)
    assert len(set(before)) == 4
    browser.evaluate("byId('time').value = 150; byId('time').dispatchEvent(new Event('input'))")
    assert all(one != other for one, other in zip(before, browser.evaluate(pictures), strict=True))
    browser.evaluate(
        "byId('method-b').value = 2; byId('method-b').dispatchEvent(new Event('change'))"
    )
    assert browser.evaluate(chosen) == ["remote (R)", "Genie (DG)"], "they change places"
    # what the camera's view says is what the table of held objects has
    for suffix, method in (("", "remote"), ("-b", "genie")):
        said = browser.evaluate(f"byId('camera{suffix}').getAttribute('aria-label')")
        car, held, missed, ghosts = re.match(
            r"What (\w+)'s .*: (\d+) held and there, (\d+) missed, (\d+) false objects?", said
        ).groups()
        rows = run.held_objects.query(f"method == '{method}' and car == '{car}'")
        rows = rows[(rows.begin_ns <= 1.5 * NS) & ~(rows.end_ns <= 1.5 * NS)]
        judged = rows["judged"].value_counts()
        counts = judged.get("right", 0), judged.get("missed", 0)
        assert (int(held), int(missed)) == counts
        assert int(ghosts) == len(rows) - sum(counts)


def test_boxes_in_the_camera_stand_where_the_objects_are(browser, file, run):
    """A pinhole camera on a flat road: the borders of boxes have the colour of right objects."""
    browser.open(file)
    browser.evaluate("byId('time').value = 150; byId('time').dispatchEvent(new Event('input'))")
    car = browser.evaluate("byId('camera-of').selectedOptions[0].text")
    poses = run.poses.query(f"car == '{car}' and stream == 'camera_02' and stamp_ns <= {1.5 * NS}")
    pose = poses.sort_values("stamp_ns").iloc[-1]
    width, height = browser.evaluate("[byId('camera').clientWidth, byId('camera').clientHeight]")
    focus = width / 2 / math.tan(pose["horizontal_fov_rad"] / 2)
    rows = run.held_objects.query(f"method == 'genie' and car == '{car}' and judged == 'right'")
    rows = rows[(rows.begin_ns <= 1.5 * NS) & ~(rows.end_ns <= 1.5 * NS)]
    drawn, seen = 0, 0
    for row in rows.itertuples():
        east, north = row.east_m - pose["east_m"], row.north_m - pose["north_m"]
        bearing = pose["heading_rad"] - math.atan2(north, east)  # to the right
        ahead = math.hypot(east, north) * math.cos(bearing)
        size = SIZES[row.label]
        half = focus * (size.length_m + size.width_m) / 4 / ahead
        foot = 0.46 * height + focus * 1.65 / ahead
        middle = foot - focus * size.height_m / ahead / 2
        for border in (-half, half):
            x = width / 2 + focus * math.tan(bearing) + border
            if 3 < x < width - 3 and middle < height - 3:
                seen += 1
                drawn += browser.evaluate(
                    f"(() => {{ const data = byId('camera').getContext('2d')"
                    f".getImageData({round(x) - 2}, {round(middle)}, 5, 1).data;"
                    " const hex = [...Array(5).keys()].map((i) => '#' + [...data.slice(4 * i,"
                    " 4 * i + 3)].map((part) => part.toString(16).padStart(2, '0')).join(''));"
                    " return hex.includes(colour('hit')); })()"
                )
    assert drawn > 0.7 * seen > 1, "another box may hide a border"


def run_end_us(page: str) -> int:
    return embedded(page)["replay"]["end_us"]


def test_button_and_key_jump_to_the_greatest_difference(browser, file, page, run):
    """Objects that are wrong or missed, counted from the table of held objects."""
    wrong = run.held_objects[run.held_objects["judged"] != "right"]

    def count(method: str, t_ns: float) -> int:
        rows = wrong[wrong["method"] == method]
        return ((rows.begin_ns <= t_ns) & ~(rows.end_ns <= t_ns)).sum()

    browser.open(file)
    browser.evaluate("byId('differ').click()")
    said = browser.evaluate("byId('moment').textContent")
    seconds, genie, remote = re.match(
        r"1 of \d+: ([\d.]+) s: Genie \(DG\) (\d+) wrong or missed, remote \(R\) (\d+) ", said
    ).groups()
    address = browser.evaluate("location.hash")
    exact_ns = float(re.match(r"#t=([\d.]+)&", address)[1]) * NS
    assert exact_ns == pytest.approx(float(seconds) * NS, abs=NS / 100)
    assert (int(genie), int(remote)) == (count("genie", exact_ns), count("remote", exact_ns))
    everywhere = [
        abs(count("genie", t_ns) - count("remote", t_ns)) for t_ns in range(0, 2 * NS, NS // 20)
    ]
    assert abs(int(genie) - int(remote)) >= max(everywhere) - 1 > 5
    judged_until_ns = run.held["stamp_ns"].max()
    moments = browser.evaluate(
        "(() => { const run = decode(DATA.replay, ABOUT);"
        " return momentsOf(run, run.methods.slice(0, 2)).map((moment) => moment.t); })()"
    )
    assert len(moments) > 1 and max(moments) <= judged_until_ns / 1000 < run_end_us(page)
    browser.evaluate("byId('map-b').focus()")
    for key, begin in (("n", "2 of"), ("p", "1 of")):
        browser.press(key)
        assert browser.evaluate("byId('moment').textContent").startswith(begin)


def test_an_address_leads_to_an_instant_and_two_methods(browser, file):
    browser.open(file)
    browser.evaluate("byId('method').value = 0; byId('method').dispatchEvent(new Event('change'))")
    browser.evaluate("byId('time').value = 123; byId('time').dispatchEvent(new Event('input'))")
    assert browser.evaluate("location.hash") == "#t=1.230&methods=local,remote"
    state = "[byId('clock').value, byId('method').value, byId('method-b').value]"
    for address, clock, methods in (
        ("#t=0.5&methods=remote,genie", "0.50 s", ["1", "2"]),
        ("#t=1.25&methods=unknown,local", "1.25 s", ["0", "1"]),
        ("#t=99&methods=%zz", "2.", ["0", "1"]),
        ("#t=x", "2.", ["0", "1"]),
    ):
        browser.evaluate(
            f"new Promise(done => {{ location.hash = '{address}'; setTimeout(done, 100) }})"
        )
        told = browser.evaluate(state)
        assert told[0].startswith(clock) and told[1:] == methods, address
    elsewhere = file.with_name("elsewhere.html")
    elsewhere.write_text("<title>elsewhere</title>")
    browser.open(elsewhere)
    browser.open(file, "#t=0.75&methods=remote,local")
    assert browser.evaluate(state) == [browser.evaluate("byId('clock').value"), "1", "0"]
    assert browser.evaluate("byId('clock').value").startswith("0.75 s")
    assert 0 < rectangle(browser, "play")[1] < 200, "the page begins at the replay"
    assert browser.errors == []


def test_hosts_show_what_waits_and_how_busy_they_are(browser, file, page, run):
    for method in embedded(page)["replay"]["methods"]:
        samples = run.resources.query(f"method == '{method['name']}'")
        for host, columns in method["hosts"].items():
            t_ns = np.cumsum(columns["t_us"]) * 1000
            of_host = samples[samples["resource"].str.match(rf"{host}(/|\.|->)")]
            waiting = of_host[of_host["kind"].isin(["queue", "link"])].groupby("t_ns")
            assert columns["waiting"] == [waiting["queue"].sum().get(t, 0) for t in t_ns]
            lost = np.cumsum(columns["lost"])
            assert lost.tolist() == [waiting["dropped"].sum().get(t, 0) for t in t_ns]
            busy = of_host.query("kind == 'accelerator'").set_index("t_ns")["busy_ns"]
            share = (busy[t_ns[-1]] - busy[t_ns[0]]) / (t_ns[-1] - t_ns[0])
            assert np.mean(columns["busy"][1:]) / 1000 == pytest.approx(share, abs=1e-3)
    browser.open(file)
    browser.evaluate("byId('time').value = 150; byId('time').dispatchEvent(new Event('input'))")
    columns = of_method(embedded(page)["replay"], "genie")["hosts"]["car1"]
    now = np.searchsorted(np.cumsum(columns["t_us"]), 1_500_000, side="right") - 1
    said = browser.evaluate("byId('hosts').getAttribute('aria-label')")
    busy, waiting, lost = re.search(
        r"car1 busy ([\d.]+) %, (\d+) waiting, (\d+) lost", said
    ).groups()
    assert float(busy) == pytest.approx(columns["busy"][now] / 10, rel=5e-3)
    assert int(waiting) == columns["waiting"][now]
    assert int(lost) == sum(columns["lost"][: now + 1]) > 0


def test_messages_travel_on_the_links_that_the_steps_name(browser, file, run):
    """Each once, even if it is on the way of both answers to a frame."""
    browser.open(file)
    steps = run.steps[run.steps["place"].str.contains("->") & (run.steps["part"] != "queueing")]
    for method in run.methods:
        rows = steps[steps["method"] == method.name]
        keys = ["car", "stream", "stamp_ns", "place", "begin_ns"]
        expected = rows.drop_duplicates(keys).sort_values("begin_ns")
        shown = browser.evaluate(
            "decode(DATA.replay, ABOUT).methods"
            f".find((method) => method.name === '{method.name}').messages.all"
            ".map((message) => [message.from, message.to, message.begin, message.end])"
        )
        assert len(shown) == len(expected)
        for column, place in (("begin_ns", 2), ("end_ns", 3)):
            times_us = sorted(message[place] for message in shown)
            assert times_us == pytest.approx(sorted(expected[column] / 1000), abs=3)
        assert sorted(f"{a}->{b}" for a, b, *_ in shown) == sorted(expected["place"])


def test_keys_move_the_time_change_the_method_and_play(browser, file):
    browser.open(file)
    for canvas in ("map", "lanes"):
        browser.evaluate(f"byId('{canvas}').focus()")
        before = int(browser.evaluate("byId('time').value"))
        browser.press("ArrowRight")
        assert int(browser.evaluate("byId('time').value")) == before + 10
        browser.press("ArrowLeft")
        browser.press("ArrowUp")
        assert browser.evaluate("byId('method').selectedOptions[0].text") == "remote (R)"
        assert "under remote (R)" in browser.evaluate(
            "byId('story').querySelector('h3').textContent"
        )
        browser.press("ArrowDown")
        for word in ("Pause", "Play"):
            browser.press(" ")
            assert browser.evaluate("byId('play').textContent") == word
    browser.evaluate("byId('strip').focus()")
    browser.press(" ")
    assert browser.evaluate("byId('play').textContent") == "Pause"


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
    browser.evaluate(
        "byId('which-frame').value = 99999; byId('which-frame').dispatchEvent(new Event('change'))"
    )
    last = int(browser.evaluate("byId('which-frame').value"))
    assert 0 < last < 99999
    assert f"frame {last}, under" in browser.evaluate("byId('story').textContent")


def test_a_click_on_the_street_chooses_the_nearest_car(browser, file):
    browser.open(file)
    browser.click(*middle(browser, "map"))
    assert re.match(
        r"car\d, camera_\d\d, frame \d+", browser.evaluate("byId('frame-told').textContent")
    )
    assert browser.errors == []


def test_a_curve_is_read_off_with_the_pointer_and_with_keys(browser, file):
    browser.open(file)
    browser.move(*middle(browser, "cdf"))
    told = browser.evaluate("byId('cdf').querySelector('.tip').textContent")
    assert told.startswith("within ")
    assert "Genie (DG):" in told
    browser.evaluate("byId('cdf').querySelector('svg[tabindex]').focus()")
    browser.press("ArrowRight")
    moved = browser.evaluate("byId('cdf').querySelector('.tip').textContent")
    assert moved.startswith("within ")
    assert moved != told
    key = "byId('cdf').querySelector('.keys button')"
    browser.evaluate(f"{key}.click()")
    assert browser.evaluate(f"{key}.getAttribute('aria-pressed')") == "false"


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
                "genie.object_map.threshold": "empirical",
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
    assert browser.evaluate("byId('side-b').hidden") == alone
    heading = browser.evaluate("byId('h-street').textContent")
    assert heading == ("Replay" if alone else "Replay: two methods on one clock")


def test_a_page_without_replay_still_draws(browser, tmp_path, run):
    browser.open(
        replace(run, tables={**run.tables, "poses": run.tables["poses"].rows([])}).report(
            tmp_path / "r.html"
        )
    )
    assert browser.errors == []
    assert browser.evaluate("byId('street').hidden")
    assert "Street" not in browser.evaluate("document.querySelector('nav').innerText"), (
        "no way to what is not there"
    )


def test_markup_in_names_is_shown_as_text(browser, tmp_path, run):
    browser.open(evil_run(run).report(tmp_path / "r.html"))
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.evaluate("byId('name').textContent") == EVIL
    assert browser.evaluate("document.title").startswith(EVIL.split("\u2028")[0])
    assert browser.evaluate("document.querySelectorAll('img').length") == 0
    assert browser.errors == []
    assert browser.requests == [(tmp_path / "r.html").as_uri()]


def test_whoever_wants_less_motion_gets_none(browser, file):
    browser.size(1200, 900, calm=True)
    browser.open(file)
    first = browser.evaluate("byId('clock').value")
    browser.evaluate("new Promise(done => setTimeout(done, 300))")
    assert browser.evaluate("byId('clock').value") == first
    assert browser.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
