"""The pages of the reference, which are made with the site."""

from __future__ import annotations

import pytest

from genie_sim.analysis.registry import METRICS
from tests.checkout import REPOSITORY
from tools.reference import settings
from tools.reference.pages import texts


@pytest.fixture(scope="module")
def written() -> dict[str, str]:
    return texts()


@pytest.mark.slow
def test_the_reference_is_the_same_on_every_machine(written: dict[str, str]):
    for name, text in written.items():
        assert str(REPOSITORY) not in text and " at 0x" not in text, name


def test_every_metric_stands_in_the_reference(written: dict[str, str]):
    for name, metric in METRICS.items():
        assert f"- `{name}`, {metric.label}" in written["reference/metrics.md"], name


def test_every_setting_is_explained_once(written: dict[str, str]):
    assert settings.unexplained() == []
    assert set(settings.SEE) <= set(settings.paths())
    pages = written["reference/scenario.md"]
    for path in settings.paths():
        assert pages.count(f"### `{path}` {{#") == 1, path
    assert "### `name` {#name}\n\ntext\n\nThe name of the results;" in pages
    assert "{#genie.request_expiry}\n\nduration such as `30 ms` or `null`; default `2 s`\n" in pages
    assert "{#genie.eviction}\n\n`fifo` · `lru` · `lfu` · `ttl` or" in pages
