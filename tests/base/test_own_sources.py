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
        "import json\nimport yaml.nodes\nfrom mine_helper import VALUE\n"
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


def test_only_what_is_imported_from_beside_it_identifies_a_class(folder: Path, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("lib")
    (elsewhere / "mine_library.py").write_text("VALUE = 1\n")
    sys.path.append(str(elsewhere))
    try:
        (folder / "mine_helper.py").write_text("from mine_library import VALUE\n")
        before = found()
        (elsewhere / "mine_library.py").write_text("VALUE = 20\n")
        assert found() == before
    finally:
        sys.path.remove(str(elsewhere))


def test_a_file_that_is_imported_late_counts_as_well(folder: Path):
    (folder / "mine_link.py").write_text(
        "class Link:\n    value = 11\n\n    def run(self):\n        import mine_late\n"
    )
    (folder / "mine_late.py").write_text("VALUE = 1\n")
    before = found()
    (folder / "mine_late.py").write_text("VALUE = 2\n")
    assert found()[1] != before[1]


def test_packages_beside_an_installed_one_are_not_its_own(folder: Path, monkeypatch):
    installed = folder / "site-packages"
    (installed / "mine_installed").mkdir(parents=True)
    (installed / "mine_installed" / "__init__.py").write_text("")
    (installed / "mine_installed" / "link.py").write_text(
        "import mine_other\nfrom mine_installed import law\n\n\nclass Link:\n    pass\n"
    )
    (installed / "mine_installed" / "law.py").write_text("")
    (installed / "mine_other.py").write_text("")
    monkeypatch.syspath_prepend(str(installed))

    def digest() -> str:
        plugins.resolve("link model", "mine_installed.link:Link", {})
        return plugins.code_digest("link model", "mine_installed.link:Link")

    before = digest()
    (installed / "mine_other.py").write_text("VALUE = 2\n")
    assert digest() == before
    (installed / "mine_installed" / "law.py").write_text("VALUE = 2\n")
    assert digest() != before


def test_an_object_such_as_a_metric_is_identified_by_the_module_that_has_it(folder: Path):
    """In every process: the workers of a study ask for it, too."""
    (folder / "mine_late.py").write_text("import fractions\n\nlate = fractions.Fraction(1, 2)\n")
    before = plugins.code_digest("metric", "mine_late:late")
    del sys.modules["mine_late"]  # another process has another object
    assert plugins.code_digest("metric", "mine_late:late") == before
    (folder / "mine_late.py").write_text("import fractions\n\nlate = fractions.Fraction(1, 3)\n")
    assert plugins.code_digest("metric", "mine_late:late") != before


def test_a_class_without_a_file_is_like_no_other():
    """Nobody can tell whether two of them are the same."""
    space: dict[str, type] = {}
    exec("class Link: pass", space)
    first = space["Link"]
    exec("class Link: pass", space)
    assert own_sources.digest(first, "nowhere") == own_sources.digest(first, "nowhere")
    assert own_sources.digest(first, "nowhere") != own_sources.digest(space["Link"], "nowhere")
