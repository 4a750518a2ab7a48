"""The page of the guide and its notebook are true: their code runs on the demo."""

import os
import pathlib
import re
import shutil

import nbformat
import pytest
from nbclient import NotebookClient

from conftest import Demo

GUIDE = pathlib.Path(__file__).parents[3] / "src/guide"


def test_the_code_of_the_page_runs(demo: Demo, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (GUIDE / "python.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 6
    monkeypatch.chdir(demo.folder)
    names: dict[str, object] = {}
    for number, block in enumerate(blocks):
        exec(compile(block, f"python.md, block {number}", "exec"), names)


def test_the_notebook_runs(demo: Demo, tmp_path: pathlib.Path) -> None:
    notebook = nbformat.read(GUIDE / "main_job.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "kept without outputs"
    shutil.copytree(demo.folder / "demo/scans", tmp_path / "demo/scans")
    shutil.copytree(demo.robots, tmp_path / "demo/robots")
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": os.fspath(tmp_path)}})
    client.execute()
    assert (tmp_path / "demo/result/result.json").is_file()
