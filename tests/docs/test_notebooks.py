"""Every notebook runs from top to bottom, shows its figures, and is kept without outputs."""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((REPOSITORY / "notebooks").glob("*.ipynb"))
LONGEST_CELL_S = 300
FIGURES = {
    "1_first_look": 4,
    "2_the_papers_evaluation": 4,
    "3_your_own_cache_policy": 1,
    "4_calibrate_a_device": 2,
    "5_sweep_and_sensitivity": 2,
    "6_object_map_over_kitti": 5,
}
LONGEST_CELL_LINES = 30
# What is run instead of what a notebook says: fewer seeds and points go through the same code.
SMALLER = {
    "1_first_look": {"seeds=3": "seeds=2"},
    "3_your_own_cache_policy": {
        "CAPACITIES = (20, 50, 80, 110, 140)": "CAPACITIES = (20, 80)",
        "SEEDS = 3": "SEEDS = 2",
        "for begin_s in (0, 2, 4, 6, 8)]": "for begin_s in (0, 8)]",
    },
    "5_sweep_and_sensitivity": {
        "overlaps(0, 0.25, 0.5, 0.75, 1)": "overlaps(0, 0.5, 1)",
        "seeds=3": "seeds=2",
    },
}


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    return [
        one
        for one in json.loads(path.read_text(encoding="utf-8"))["cells"]
        if one["cell_type"] == kind
    ]


def test_there_is_a_notebook_for_every_figure_count():
    assert [path.stem for path in NOTEBOOKS] == sorted(FIGURES)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs_and_reads_like_a_text(path: Path):
    for cell in cells(path, "code"):
        assert cell["outputs"] == [] and cell["execution_count"] is None, (
            "strip the outputs before you commit"
        )
        assert len(cell["source"]) <= LONGEST_CELL_LINES, f"a long cell: {cell['source'][0]}"
    assert len(cells(path, "markdown")) >= 0.7 * len(cells(path, "code")), "prose between the cells"
    assert "".join(cells(path, "markdown")[0]["source"]).startswith("# ")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_reads_nothing_that_a_user_does_not_have(path: Path):
    """What it imports is installed with genie-sim."""
    for cell in cells(path, "code"):
        code = "".join(line for line in cell["source"] if not line.startswith("%"))
        for node in ast.walk(ast.parse(code)):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert str(name).split(".")[0] in {
                    "genie_sim",
                    "matplotlib",
                    "numpy",
                    "pandas",
                    "os",
                    "pathlib",
                    "scipy",
                }


def smaller(path: Path) -> str:
    """A notebook's text with what ``SMALLER`` says."""
    text = path.read_text(encoding="utf-8")
    for whole, less in SMALLER.get(path.stem, {}).items():
        assert whole in text, f"{path.name} has no {whole!r} any more"
        text = text.replace(whole, less)
    return text


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_figures(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    nbclient = pytest.importorskip("nbclient", reason="nbclient comes with '.[notebooks]'")
    pytest.importorskip("ipykernel", reason="ipykernel comes with '.[notebooks]'")
    nbformat = pytest.importorskip("nbformat", reason="nbformat comes with '.[notebooks]'")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.reads(smaller(path), as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=LONGEST_CELL_S,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute(env={**os.environ})
    shown = [
        output["data"]["image/png"]
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {})
    ]
    assert len(shown) == FIGURES[path.stem], f"{len(shown)} figures are shown"
    assert all(len(picture) > 5_000 for picture in shown), "a figure is empty"
