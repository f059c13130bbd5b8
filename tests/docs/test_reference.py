"""The generated pages are what the program writes: ``python -m tools.reference`` remakes them."""

from __future__ import annotations

import pytest

from genie_sim.analysis.registry import METRICS
from tools.reference import settings
from tools.reference.pages import DOCS, site_texts, texts


@pytest.fixture(scope="module")
def written() -> dict[str, str]:
    return texts()


def test_the_committed_reference_is_what_the_program_writes(written: dict[str, str]):
    for name, text in written.items():
        committed = (DOCS / name).read_text(encoding="utf-8")
        assert committed == text, f"docs/{name}: run python -m tools.reference"


def test_no_page_of_the_reference_is_left_over(written: dict[str, str]):
    by_hand = {"reference/api.md"}
    there = {path.relative_to(DOCS).as_posix() for path in (DOCS / "reference").glob("*.md")}
    assert there - by_hand == set(written)


@pytest.mark.slow
def test_the_reference_is_the_same_on_every_machine(written: dict[str, str]):
    for name, text in (written | site_texts()).items():
        assert str(DOCS.parent) not in text and " at 0x" not in text, name


def test_every_metric_stands_in_the_reference(written: dict[str, str]):
    for name, metric in METRICS.items():
        assert f"- `{name}`, {metric.label}" in written["reference/metrics.md"], name


def test_every_setting_is_explained_once():
    assert settings.unexplained() == []
    assert set(settings.SEE) <= set(settings.paths())
    pages = site_texts()["reference/scenario.md"]
    for path in settings.paths():
        assert pages.count(f"### `{path}` {{#") == 1, path
    assert "### `name` {#name}\n\ntext\n\nThe name of the results;" in pages
    assert "{#genie.request_expiry}\n\nduration such as `30 ms` or `null`; default `2 s`\n" in pages
    assert "{#genie.eviction}\n\n`fifo` · `lru` · `lfu` · `ttl` or" in pages
