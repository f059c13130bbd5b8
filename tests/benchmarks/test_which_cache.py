"""Which cache to build: designs are chosen by the tuning set, and the page says what the file
says.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from benchmarks import which_cache as study
from benchmarks import which_cache_page as page
from benchmarks.speed_page import filled


def design(
    name: str, tuning_f1: float, tuning_bytes: float, f1: list[float], **more: Any
) -> list[dict[str, Any]]:
    """A row for each seed."""
    return [
        {
            "condition": "ethernet",
            "method": name.partition("-")[0],
            "design": name,
            "tuning_f1": tuning_f1,
            "tuning_bytes": tuning_bytes,
            "tuning_edge": 1.0,
            "replicate": seed,
            "f1": value,
            "bytes": tuning_bytes,
            "edge": 2.0,
            "first_ms": 9.0,
            "ghosts": 0.2,
            **more,
        }
        for seed, value in enumerate(f1, start=2)
    ]


DESIGNS = pd.DataFrame(
    [
        *design("genie-1", 0.80, 20_000, [0.81, 0.80, 0.82]),
        *design("genie-2", 0.79, 5_000, [0.90, 0.90, 0.90]),
        *design("remote-1", 0.805, 90_000, [0.78, 0.79, 0.80]),
        *design("remote-2", 0.805, 80_000, [0.50, 0.50, 0.50]),
        *design("local-1", 0.70, 0, [0.70, 0.70, 0.70]),
    ]
)


def of_method(name: str) -> pd.DataFrame:
    return DESIGNS[DESIGNS["method"] == name]


def test_the_most_accurate_design_is_that_of_the_tuning_set_and_of_equals_the_smaller():
    assert page.accurate(of_method("genie")) == "genie-1"
    assert page.accurate(of_method("remote")) == "remote-2"


def test_the_cheapest_design_is_within_a_hundredth_of_the_best_of_all():
    assert page.cheapest(DESIGNS, 0.805) == "genie-1"
    assert page.cheapest(DESIGNS, 0.80) == "genie-2"
    assert page.cheapest(of_method("local"), 0.805) is None


def test_differences_are_paired_by_replicate():
    """Differences .03, .01, .02: mean .02, t(2) = 4.3027 times .01 / sqrt(3)."""
    found = page.difference(DESIGNS, "genie-1", "remote-1")
    assert found.value == pytest.approx(0.02)
    assert found.high - found.value == pytest.approx(4.3027 * 0.01 / 3**0.5, rel=1e-4)


def test_at_the_price_of_another_is_the_most_accurate_that_sends_no_more():
    designs = DESIGNS.assign(energy=DESIGNS["bytes"] / 1e5)
    assert page.at_the_price(designs, "genie", "remote").design == "genie-1"
    less = designs.assign(tuning_bytes=designs["tuning_bytes"] + 1e5 * (designs["f1"] == 0.5))
    found = page.at_the_price(less, "remote", "remote")
    assert (found.design, found.kilobytes) == ("remote-1", "90.0 kB")
    assert found.f1.startswith("+0.000")


def test_no_worse_is_in_accuracy_bytes_and_edge_time():
    numbers = page.means_of(DESIGNS)
    assert page.is_no_worse(numbers, "genie-2", "genie-1")
    assert not page.is_no_worse(numbers, "genie-1", "genie-2")
    more = page.means_of(DESIGNS.assign(edge=DESIGNS["edge"] + (DESIGNS["design"] == "genie-2")))
    assert not page.is_no_worse(more, "genie-2", "genie-1")


def test_spaces_are_those_that_ship_with_a_tracker_behind_every_method_but_the_paced_genie():
    spaces = study.Condition("caches", "baselines", {}, study.EVERY).design().methods
    for name, space in spaces.items():
        has_tracker = "consumer.name" in space.settings
        assert has_tracker == (name not in ("genie", study.LOOKS)), name
        assert has_tracker == ("tracker_tau" in space.parameters), name
    assert list(spaces["genie"].parameters) == [
        "every",
        "in_flight",
        "own",
        "p_min",
        "tau",
        "encoding",
    ]
    assert spaces["published"].parameters["lifetime"].when == {"freshness": ("ttl",)}
    assert spaces["cachier"].settings["method.cloud"] == "edge1"
    fixed = study.space(study.LOOKS, {"image_encoding": "raw"})
    assert "image_encoding" not in fixed["set"]


def test_the_page_says_what_the_file_says():
    text = page.PAGE.read_text(encoding="utf-8")
    for name, block in page.blocks(page.read()).items():
        assert filled(text, name, block, str(page.PAGE)) == text, name


def test_the_figure_has_a_panel_for_each_condition():
    designs = page.read()
    panels = page.figure(designs).axes
    assert [ax.get_title() for ax in panels] == [
        study.TITLES[name] for name in designs["condition"].unique()
    ]
    assert all(ax.lines for ax in panels)
