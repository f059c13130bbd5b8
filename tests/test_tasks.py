"""The tasks of noxfile.py and what they need: what they let pass and what they stop."""

from __future__ import annotations

import re

import pytest
import yaml

from genie_sim import __version__
from tests.checkout import REPOSITORY

TASKS = (
    "lint",
    "types",
    "test",
    "rest",
    "ros",
    "coverage",
    "docs",
    "bench",
    "mutate",
    "lower_bounds",
    "lock",
    "release",
)


@pytest.fixture
def noxfile():
    pytest.importorskip("nox", reason="nox comes with '.[dev]'")
    import noxfile

    return noxfile


@pytest.mark.parametrize("tag", ["v0.0.1", __version__, ""])
def test_a_tag_that_is_not_the_version_is_no_release(noxfile, monkeypatch, tag: str):
    monkeypatch.chdir(REPOSITORY)
    with pytest.raises(SystemExit, match=r"^release: the tag is"):
        noxfile.release_version(tag)


def test_the_tag_of_the_version_is_a_release(noxfile, monkeypatch):
    monkeypatch.chdir(REPOSITORY)
    assert noxfile.release_version(f"v{__version__}") == __version__


def test_every_task_is_listed(noxfile):
    import nox

    assert set(TASKS) <= {
        name for name in dir(noxfile) if isinstance(getattr(noxfile, name), nox._decorators.Func)
    }


def test_workflows_use_actions_by_digest_only():
    """A tag or a branch can be moved to other code; a digest cannot."""
    used = []
    for path in (REPOSITORY / ".github" / "workflows").glob("*.yml"):
        text = path.read_text(encoding="utf-8")
        yaml.safe_load(text)
        used += re.findall(r"uses: (.*)", text)
    assert used
    for action in used:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}  # v[\d.]+", action), action


def test_hooks_pin_their_tools_and_use_the_formatter_that_is_installed():
    """Another version of the formatter would lay the code out in another way."""
    hooks = yaml.safe_load((REPOSITORY / ".pre-commit-config.yaml").read_text(encoding="utf-8"))
    tools = [
        tool for hook in hooks["repos"][0]["hooks"] for tool in hook["additional_dependencies"]
    ]
    assert tools and all(re.fullmatch(r"[\w-]+==[\d.]+", tool) for tool in tools)
