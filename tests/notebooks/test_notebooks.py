"""Every notebook runs from top to bottom, is stored with its outputs, and leaves algorithms to the library."""

from __future__ import annotations

import ast
import os
import re
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from spf.errors import RenderUnavailableError
from spf.render import probe_opengl

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # Jupyter's own, not ours
    import nbformat
    from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LONGEST = 15  # lines of a function: one that is longer is an algorithm, and belongs into spf
MOST_BYTES = 800_000

pytestmark = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def code_of(path: Path) -> list[Any]:
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def python_of(path: Path) -> ast.Module:
    """The code of a notebook, without the commands of IPython."""
    text = "\n".join(cell.source for cell in code_of(path))
    return ast.parse(re.sub(r"^%.*$", "", text, flags=re.MULTILINE))


def imported_by(tree: ast.Module) -> set[str]:
    """Modules from which a notebook imports names."""
    return {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}


@cache
def skip_without_opengl() -> None:
    """Skip the test, saying why, where nothing draws off-screen."""
    try:
        probe_opengl()
    except RenderUnavailableError as error:
        pytest.skip(str(error))


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if any(name.startswith("spf.render") for name in imported_by(python_of(path))):
        skip_without_opengl()
    monkeypatch.setitem(os.environ, "PYTHONWARNINGS", "error::UserWarning:spf")
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    printed = [output for cell in notebook.cells for output in cell.get("outputs", []) if "name" in output]
    assert [output.text for output in printed if output.name == "stderr"] == []


def test_a_notebook_is_stored_with_its_outputs(path: Path) -> None:
    assert path.stat().st_size <= MOST_BYTES
    outputs = [output for cell in code_of(path) for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output.output_type == "error" for output in outputs)
    counts = [cell.execution_count for cell in code_of(path)]
    assert counts == list(range(1, len(counts) + 1)), "run it from a fresh kernel before it is stored"


def test_a_notebook_defines_no_algorithm(path: Path) -> None:
    tree = python_of(path)
    assert any(name == "spf" or name.startswith("spf.") for name in imported_by(tree))
    assert not [node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    lengths = {function.name: (function.end_lineno or 0) - function.lineno + 1 for function in functions}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST} == {}


def test_a_notebook_is_listed(path: Path) -> None:
    assert f"({path.name})" in (FOLDER / "README.md").read_text(encoding="utf-8")
