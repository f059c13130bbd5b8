"""What identifies a class of the user's own: its files, and those of its own that it imports."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from genie_sim.base import own_sources, plugins


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with modules of the user's own, whose names nobody else has."""
    (tmp_path / "mine_pack").mkdir()
    (tmp_path / "mine_pack" / "__init__.py").write_text("")
    (tmp_path / "mine_pack" / "inner.py").write_text("from . import deep\n")
    (tmp_path / "mine_pack" / "deep.py").write_text("DEPTH = 1\n")
    (tmp_path / "mine_helper.py").write_text("VALUE = 1\n")
    (tmp_path / "mine_link.py").write_text(
        "import json\nimport scipy.io.wavfile\nfrom mine_helper import VALUE\n"
        "from mine_pack.inner import deep\n\n\n"
        "class Link:\n    value = VALUE + 10 * deep.DEPTH\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("mine_")]:
        del sys.modules[name]


def found() -> tuple[int, str]:
    made = plugins.resolve("link model", "mine_link:Link", {})
    return made.value, plugins.code_digest("link model", "mine_link:Link")


@pytest.mark.parametrize(
    ("edited", "text", "value"),
    [("mine_helper.py", "VALUE = 2", 12), ("mine_pack/deep.py", "DEPTH = 3", 31)],
)
def test_an_edited_module_is_imported_anew_and_identified_anew(
    folder: Path, edited: str, text: str, value: int
):
    before = found()
    assert before[0] == 11 and found() == before
    (folder / edited).write_text(text)
    after = found()
    assert after[0] == value and after[1] != before[1]


def test_a_file_that_is_not_imported_counts_nowhere(folder: Path):
    (folder / "mine_helper.py").write_text("VALUE = 1\n")
    before = found()
    (folder / "mine_other.py").write_text("VALUE = 9\n")
    assert found() == before


def test_installed_packages_are_not_looked_into(folder: Path):
    sys.modules.pop("scipy.io.wavfile", None)
    own = {name for name, _ in own_sources._own_modules("mine_link")}
    assert own == {"mine_link", "mine_helper", "mine_pack", "mine_pack.inner", "mine_pack.deep"}
    assert "scipy.io.wavfile" not in sys.modules


def test_a_class_without_a_file_is_like_no_other():
    """Nobody can tell whether two of them are the same."""
    space: dict[str, type] = {}
    exec("class Link: pass", space)
    first = space["Link"]
    exec("class Link: pass", space)
    assert own_sources.digest(first) == own_sources.digest(first)
    assert own_sources.digest(first) != own_sources.digest(space["Link"])
