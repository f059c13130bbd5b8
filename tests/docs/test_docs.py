"""The documentation is true: every page is followed from top to bottom, links lead somewhere, and
the site builds.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.checkout import copied
from tests.docs.blocks import abbreviated
from tests.run_page import Reader, accepted, blocks
from tests.test_imports import MAY_IMPORT
from tools.reference.pages import texts

REPOSITORY = Path(__file__).resolve().parents[2]
DOCS = REPOSITORY / "docs"
PAGES = {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*.md"))}
# they need the whole evaluation, KITTI
WITH_TESTS_OF_THEIR_OWN = {"paper.md", "perception.md"}
FOLLOWED = [
    name
    for name, path in PAGES.items()
    if name not in WITH_TESTS_OF_THEIR_OWN
    and any(not one.not_run for one in blocks(path.read_text(encoding="utf-8")))
]
# Long ones. Their commands are tested in tests/study, tests/cli and tests/worlds/traffic, the
# method of extend/method.md in test_extend_pages.py; index.md runs what latencies.md does.
NIGHTLY = (
    *("explanation/latencies.md", "explanation/looks.md", "extend/method.md", "sweeps.md"),
    *(f"how-to/{page}.md" for page in ("compare", "fleets", "results", "sumo")),
)


@pytest.mark.process
@pytest.mark.slow
def test_the_readme_does_what_it_shows(as_a_reader: Path):
    copied(REPOSITORY / "scenarios", as_a_reader / "scenarios")
    follow(REPOSITORY / "README.md")
    assert (as_a_reader / "cdf.pdf").exists() and (as_a_reader / "report.html").exists()


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [  # examples have tests of their own, tests/examples
        pytest.param(
            name, marks=pytest.mark.nightly if name.startswith(("examples/", *NIGHTLY)) else ()
        )
        for name in FOLLOWED
    ],
)
def test_a_page_does_what_it_shows(name: str, as_a_reader: Path):
    """Look at the differences; if the page should show them: run it again by hand with --accept,
    read, commit.
    """
    if name.startswith("examples/"):
        copied(REPOSITORY / "examples", as_a_reader / "examples")
    follow(PAGES[name])


def follow(page: Path) -> None:
    reader = Reader(page.name)
    reader.read(page.read_text(encoding="utf-8"))
    assert not reader.problems, "\n".join(reader.problems)


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path):
    pytest.importorskip("material", reason="mkdocs-material comes with '.[docs]'")
    built = subprocess.run(
        [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--site-dir",
            str(tmp_path / "site"),
        ],
        cwd=REPOSITORY,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "site" / "index.html").is_file()


def test_every_name_of_the_registries_is_explained():
    """What ``genie-sim list`` knows of similarities, evictions, rules and links stands in the
    documentation.
    """
    from genie_sim.cli import catalogue

    text = "".join(path.read_text(encoding="utf-8") for path in PAGES.values())
    text += "".join(texts().values())
    for kind in ("similarities", "evictions", "rules", "links"):
        for name, _ in catalogue.KINDS[kind]():
            assert f"`{name}`" in text, f"{kind}: {name} is in no page"


def test_every_reading_of_the_paper_is_explained():
    """Each setting under ``genie:`` and each of its choices stands in the page on how the paper is
    read.
    """
    from genie_sim.scenario.schema import json_schema

    page = PAGES["explanation/paper-readings.md"].read_text(encoding="utf-8")
    classes = json_schema("scenario")["$defs"]
    for settings in (classes[name]["properties"] for name in ("GenieRules", "ObjectMapRules")):
        for name, field in settings.items():
            assert f"`{name}`" in page or f"`object_map.{name}`" in page, (
                f"genie.{name} is not explained"
            )
            for choice in field.get("enum", []):
                assert f"`{choice}`" in page, f"genie.{name}: {choice} is not explained"


@pytest.mark.process
def test_a_class_in_the_current_folder_is_found_by_the_installed_command(tmp_path: Path):
    """``-P``: Python does not look into the current folder by itself, as with an installed
    ``genie-sim``.
    """
    (tmp_path / "same.py").write_text("# nobody here\n")
    ran = subprocess.run(
        [
            sys.executable,
            "-P",
            "-m",
            "genie_sim",
            "run",
            "street_1car_homo",
            "--set",
            "genie.similarity=same:Nobody",
        ],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "module 'same' has no attribute 'Nobody'" in ran.stderr


def test_files_that_pages_speak_of_exist():
    """``tests/theory/test_queues.py`` and the like, in the repository."""
    for name, path in PAGES.items():
        text = path.read_text(encoding="utf-8")
        folders = "tests|genie_sim|notebooks|scenarios|studies"
        for file in re.findall(rf"`((?:{folders})/[\w./-]+\.\w+)`", text):
            assert (REPOSITORY / file).exists(), f"docs/{name}: {file} is not there"


LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")


def test_every_link_of_a_page_leads_somewhere():
    anchors = {path: _anchors(path) for path in (*PAGES.values(), REPOSITORY / "README.md")}
    for name, path in PAGES.items():
        text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        for link in LINK.findall(text):
            if re.match(r"\w+:", link):
                continue
            file, _, anchor = link.partition("#")
            target = (path.parent / file).resolve() if file else path
            assert target.is_file(), f"docs/{name}: {link}"
            assert not anchor or anchor in anchors[target], f"docs/{name}: {link}"


def _anchors(page: Path) -> set[str]:
    """Those that MkDocs gives to headings, and those that headings name themselves."""
    found = set()
    for heading in re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE):
        text, _, named = heading.partition(" {#")
        words = re.sub(r"[^\w\s-]", "", text).strip().lower()
        found.add(named.rstrip("}") or re.sub(r"[-\s]+", "-", words))
    return found


def test_every_page_is_in_the_navigation():
    navigation = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    pages = {*PAGES, *texts()}  # some are made with the site
    assert sorted(re.findall(r": ([\w/-]+\.md)$", navigation, re.MULTILINE)) == sorted(pages)


def test_the_drawing_of_the_packages_is_the_rule_that_tests_check():
    """It has every arrow that no longer way replaces, and no other."""
    reachable: dict[str, set[str]] = {}

    def below(package: str) -> set[str]:
        if package not in reachable:
            direct = MAY_IMPORT.get(package, ())
            reachable[package] = set(direct).union(*map(below, direct))
        return reachable[package]

    expected = {
        (package, allowed)
        for package, direct in MAY_IMPORT.items()
        for allowed in direct
        if not any(allowed in below(other) for other in direct)
    }
    page = (DOCS / "explanation" / "architecture.md").read_text(encoding="utf-8")
    drawing = next(block for block in blocks(page) if block.lines[0] == "flowchart TD")
    arrows = re.findall(r"^ +(\w+) --> (\w+)$", drawing.text, re.MULTILINE)
    assert len(arrows) == len(drawing.lines) - 1, "each line after the first is one arrow"
    assert sorted(arrows) == sorted(expected)


EXAMPLE = """
```python title="nearest.py"
LIMIT = 3
```
```python
from nearest import LIMIT
print("at most", LIMIT)
```
```text
at most 2
```
<!-- not run: needs a GPU -->
```bash
false
```
1. in a list

   ```console
   $ echo one
   two
   ```
"""


@pytest.mark.process
def test_a_page_that_shows_something_else_is_noticed_and_can_be_put_right(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.syspath_prepend("")
    reader = Reader("page.md")
    reader.read(EXAMPLE)
    numbers, echo = reader.problems
    assert numbers.startswith("page.md:10: text block prints:\nat most 3")
    assert echo.startswith("page.md:19: console block prints:\n$ echo one")
    right = accepted(EXAMPLE, reader)
    assert "at most 3" in right and "at most 2" not in right
    assert "   $ echo one\n   one\n   ```" in right


def test_a_block_that_fails_is_noticed():
    reader = Reader("page.md")
    reader.read("```python\nanswer = 1 / 0\n```\n```bash\ntouch after\n```\n")
    assert "ZeroDivisionError" in reader.problems[0] and "line 2" in reader.problems[0]
    assert not Path("after").exists(), "nothing that builds on it is run"


def test_accepted_output_leaves_out_what_the_page_leaves_out():
    shown = ["run-...: ... s simulated", "...", "first answer [ms]   9", "...", "Results: x"]
    printed = (
        "run-0123456789ab: 9.3 s simulated\n\nother [ms]    4\nfirst answer [ms]   8\nResults: x\n"
    )
    assert abbreviated(shown, printed) == [
        "run-...: ... s simulated",
        "...",
        "first answer [ms]   8",
        "...",
        "Results: x",
    ]
    assert abbreviated(["a", "b"], "a\nc\nb\n") == ["a", "c", "b"], "else all of it"
