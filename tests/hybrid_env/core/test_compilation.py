"""The cache of compiled functions: announced once, named by the sources, and somewhere else if its
folder cannot be written.
"""

import os
import runpy
from pathlib import Path

import numba
import numpy as np
import pytest

from hybrid_env.core import compilation

PROGRAM = """
import numpy as np
from hybrid_env.core.compilation import compiled, prepare

@compiled
def element(x, i):
    return x[i] + 1.0

prepare(element, np.ones(3), 1)
"""


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs the program as a new process would, and returns what it says."""
    path = tmp_path / "program.py"
    path.write_text(PROGRAM)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))

    def run(index=1):
        compilation.cache_folder.cache_clear()
        element = runpy.run_path(str(path), run_name="program")["element"]
        assert element(np.ones(3), index) == 2.0
        return capsys.readouterr().err

    yield run
    compilation.cache_folder.cache_clear()


def test_only_the_first_process_compiles_and_says_where_the_code_is_kept(tmp_path, run):
    assert f"compiling element, up to 30 s, kept in {tmp_path / 'cache'}" in run()
    assert run() == ""


def test_other_sources_and_checked_indices_have_other_folders(tmp_path, run, monkeypatch):
    run()
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 1)
    with pytest.raises(IndexError):
        run(index=5)
    monkeypatch.setattr(compilation, "__file__", str(tmp_path / "program.py"))

    assert run() != ""
    assert len(list((tmp_path / "cache").iterdir())) == 3


def test_without_a_writable_cache_the_temporary_folder_keeps_the_code(tmp_path, run, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "/dev/null/cache")
    monkeypatch.setattr(compilation.tempfile, "tempdir", str(tmp_path))

    assert f"kept in {tmp_path}" in run()
    assert run() == ""


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no owner")
def test_code_is_not_loaded_from_the_folder_of_another_user(tmp_path, run, monkeypatch):
    run()
    monkeypatch.setattr(Path, "lstat", lambda path: os.stat_result([0] * 4 + [12345] + [0] * 5))

    assert "not kept: set NUMBA_CACHE_DIR" in run()
