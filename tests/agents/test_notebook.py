"""The notebook of the docs runs as it stands."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.study
# Jupyter's own packages warn.
@pytest.mark.filterwarnings("ignore")
def test_the_notebook_runs_and_stores_no_output(monkeypatch, tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook = nbformat.read(ROOT / "docs/notebooks/first_steps.ipynb", 4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]

    assert all(cell.outputs == [] and cell.execution_count is None for cell in cells)
    nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": tmp_path}}
    ).execute()
    printed = "".join(output.get("text", "") for cell in cells for output in cell.outputs)
    assert printed.count("correct: True") >= 3
    assert "shipped" in printed
    assert "image/png" in cells[-1].outputs[-1].data
