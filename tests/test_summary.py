"""The tables that a run prints and writes: complete, in any window, and the same each time."""

from __future__ import annotations

import made_up_run
import pytest

from genie_sim.analysis import metrics, summary
from genie_sim.recording.results import Metric


@pytest.fixture(scope="module")
def found() -> list[Metric]:
    tables = made_up_run.frames(2, 3), made_up_run.lookups(2, 120), made_up_run.resources(2, 30)
    return metrics.compute(made_up_run.METHODS, *(table.to_frame() for table in tables))


def row(text: str, label: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(label)]
    return line.removeprefix(label).split()


def test_first_and_fresh_answers_stand_beside_each_other(found):
    text = summary.text(found)
    means = [("first_answer_mean", role) for role in ("local", "remote", "genie")] + [("fresh_answer_mean", "genie")]
    known = {(metric.metric, metric.method): metric.value for metric in found}
    assert row(text, "mean [ms]") == [f"{known[mean]:.3g}" for mean in means]
    above, below = text.splitlines()[1:3]
    assert (above.split(), below.split()) == (["genie", "genie"], ["local", "remote", "first", "fresh"])


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_the_tables_fit_the_window(found, width):
    text = summary.text(found, width)
    assert max(map(len, text.splitlines())) <= width
    for words in ("under 33 ms", "dropped", "empty", "image reuse", "object reuse", "confidence boost", "improvement"):
        assert words in " ".join(text.lower().split()), words


def test_the_tables_are_plain_text(found):
    for text in (summary.text(found), summary.markdown(found, "3car_hetero", "0123456789ab", 1)):
        assert text.isascii() and "\x1b" not in text


def test_unknown_is_a_dash_and_never_a_number():
    unanswered = [
        Metric("frames_published", "local", "all", "", 7, "frames", n=7),
        Metric("first_answer_mean", "local", "all", "", None, "ms"),
        Metric("answered_share", "local", "all", "", 0.0, "1", n=7),
    ]
    text = summary.text(unanswered)
    assert row(text, "mean [ms]") == ["-"]
    assert row(text, "answered  ") == ["0", "%"]
    assert "nan" not in text.lower() and "None" not in text


def test_methods_and_roles_that_were_not_simulated_have_no_column():
    local_only = [Metric("frames_published", "local", "all", "", 7, "frames", n=7)]
    text = summary.text(local_only)
    assert "genie" not in text and "Improvement" not in text and "image reuse" not in text


def test_numbers_have_three_digits_and_a_unit():
    run = [Metric("frames_published", "remote", "all", "", 1, "frames")]
    run += [Metric("image_reuse", "genie", "edge", "", 0.30612, "1", 0.1, 0.52)]
    run += [Metric("first_answer_mean", "remote", "all", "", 1234.5678, "ms")]
    run += [Metric("confidence_boost", "genie", "edge", "", 0.012345, "1")]
    text = summary.text(run)
    assert row(text, "image reuse  ") == ["30.6", "%"]
    assert row(text, "confidence boost") == ["0.0123"]
    assert row(text, "mean [ms]") == ["1,235"]


def test_the_markdown_names_the_run_and_says_what_the_intervals_mean(found):
    text = summary.markdown(found, "3car_hetero", "0123456789ab", 4)
    assert text.startswith("# 3car_hetero\n\nRun `0123456789ab`, seed 4.\n")
    assert "95 % interval inside this run" in text
    assert "50 requests in a row" in text
    mean = next(metric for metric in found if (metric.metric, metric.method) == ("first_answer_mean", "genie"))
    assert f"{mean.value:.3g} ({mean.low:.3g} to {mean.high:.3g})" in text
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.count("|") in (4, 5, 6)
    assert text == summary.markdown(list(found), "3car_hetero", "0123456789ab", 4)


def test_a_fleet_shows_its_busiest_devices_and_counts_the_others():
    run = [Metric("frames_published", "genie", "all", "", 1, "frames")]
    run += [Metric("utilization", "genie", "edge", f"edge{i:02}.accelerator", i / 100, "1") for i in range(60)]
    text = summary.text(run)
    assert "edge59.accelerator" in text and "edge10.accelerator" not in text
    assert "47 less busy ones are in metrics.json." in text  # 60, without 12 shown and one that idles


def test_any_method_whose_fresh_answers_come_later_has_both_columns_and_genies_a_table_of_each_method():
    run = []
    for method, fresh in (("swift", 20.0), ("plain", 10.0), ("slow", 30.0)):
        run.append(Metric("frames_published", method, "all", "", 1, "frames"))
        run.append(Metric("first_answer_mean", method, "all", "", 10.0, "ms"))
        run.append(Metric("fresh_answer_mean", method, "all", "", fresh, "ms"))
    run.append(Metric("improvement_first_answer", "swift", "all", "plain", 0.5, "1"))
    run += [Metric("image_reuse", method, "car", "", 0.5, "1") for method in ("swift", "slow")]
    text = summary.text(run)
    assert row(text, "mean [ms]") == ["10", "20", "10", "10", "30"]
    above, below = text.splitlines()[1:3]
    assert above.split() == ["swift", "swift", "slow", "slow"]
    assert below.split() == ["first", "fresh", "plain", "first", "fresh"]
    for title in ("Improvement by swift, of the mean", "Genies under swift", "Genies under slow"):
        assert title in text
