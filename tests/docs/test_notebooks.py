"""Every notebook is short, is kept with its outputs, and prints the same when it is run again."""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.checkout import REPOSITORY

NOTEBOOKS = sorted((REPOSITORY / "notebooks").glob("*.ipynb"))
FIRST = "1_"  # is run each time, the others at night
LONGEST_CELL_S = 600
MOST_LINES = 40
MOST_BASE64 = 200_000  # five figures of the paper
BESIDE_GENIE_SIM = {"matplotlib.pyplot", "numpy"}

Cells = list[dict[str, Any]]


def cells(path: Path, kind: str) -> Cells:
    return [
        one
        for one in json.loads(path.read_text(encoding="utf-8"))["cells"]
        if one["cell_type"] == kind
    ]


def outputs(code: Cells, kind: str) -> list[str]:
    """What cells show as ``text/plain``, ``image/png`` or ``stream``."""
    found = []
    for output in (output for cell in code for output in cell["outputs"]):
        shown = output.get("data", {}) if kind != "stream" else {kind: output.get("text", "")}
        found.append("".join(shown.get(kind, "")))
    return [text for text in found if text and not text.startswith(("<Figure", "<NotebookFigure"))]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_short_and_imports_genie_sim_alone(path: Path):
    code = ["".join(cell["source"]) for cell in cells(path, "code")]
    assert sum(len(one.splitlines()) for one in code) <= MOST_LINES
    for one in code:
        python = "\n".join(line for line in one.splitlines() if line[:1] not in "%!")
        for node in ast.walk(ast.parse(python)):
            assert not isinstance(node, ast.ImportFrom), "import genie_sim as gs"
            for name in node.names if isinstance(node, ast.Import) else ():
                assert (name.name, name.asname) == ("genie_sim", "gs") or (
                    name.name in BESIDE_GENIE_SIM
                )
    assert "".join(cells(path, "markdown")[0]["source"]).startswith("# ")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_with_outputs_and_small_figures(path: Path):
    code = cells(path, "code")
    counts = [cell["execution_count"] for cell in code]
    assert counts == list(range(1, len(code) + 1)), "run it from top to bottom, then commit"
    pictures = outputs(code, "image/png")
    assert pictures and sum(map(len, pictures)) <= MOST_BASE64
    assert not any(output["output_type"] == "error" for cell in code for output in cell["outputs"])
    assert str(REPOSITORY) not in path.read_text(encoding="utf-8")


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=() if path.stem.startswith(FIRST) else pytest.mark.nightly)
        for path in NOTEBOOKS
    ],
    ids=lambda path: path.stem,
)
def test_a_notebook_prints_what_it_is_kept_with(path: Path, tmp_path: Path, as_a_reader: Path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient comes with '.[notebooks]'")
    pytest.importorskip("ipykernel", reason="ipykernel comes with '.[notebooks]'")
    nbformat = pytest.importorskip("nbformat", reason="nbformat comes with '.[notebooks]'")
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=LONGEST_CELL_S,
        kernel_name="python3",
        coalesce_streams=True,
        resources={"metadata": {"path": str(as_a_reader)}},
    )
    client.execute(env={**os.environ, "IPYTHONDIR": str(tmp_path / "ipython")})
    again = [cell for cell in notebook.cells if cell["cell_type"] == "code"]
    kept = cells(path, "code")
    for kind in ("stream", "text/plain"):
        assert outputs(again, kind) == outputs(kept, kind)
    figures = [len(outputs(one, "image/png")) for one in (again, kept)]
    assert figures[0] == figures[1]
    assert all(len(picture) > 5_000 for picture in outputs(again, "image/png")), "empty"
