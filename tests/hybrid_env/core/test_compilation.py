"""The cache of compiled functions: announced once, named by the sources, and somewhere else if its
folder cannot be written.
"""

import os
import runpy

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
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compilation.tempfile, "tempdir", str(tmp_path / "temporary"))

    def run(index=1):
        monkeypatch.delenv(compilation.COMPILING, raising=False)
        compilation.cache_folder.cache_clear()
        compilation._say_refused.cache_clear()
        element = runpy.run_path(str(path), run_name="program")["element"]
        assert element(np.ones(3), index) == 2.0
        return capsys.readouterr().err

    yield run
    compilation.cache_folder.cache_clear()


def test_only_the_first_process_compiles_and_says_so(run):
    assert run() == "HybridTrack: compiling, for minutes the first time; code is kept\n"
    assert run() == ""


def test_other_sources_and_checked_indices_have_other_folders(tmp_path, run, monkeypatch):
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 0)
    run()
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 1)
    with pytest.raises(IndexError):
        run(index=5)
    monkeypatch.setattr(compilation, "__file__", str(tmp_path / "program.py"))

    assert run() != ""
    assert len(list((tmp_path / "cache").iterdir())) == 3


def test_the_folder_depends_on_what_a_module_imports_from_its_package(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    sources = {
        "first": "from package.second import f",
        "second": "from . import third",
        "third": "",
        "other": "",
    }
    (tmp_path / "package").mkdir()
    files = {name: tmp_path / "package" / f"{name}.py" for name in sources}
    for name, source in sources.items():
        files[name].write_text(source)
    folders = {}
    for changed in ("other", "third", "second"):
        with files[changed].open("a") as file:
            file.write("\n")
        compilation._imports.cache_clear()
        compilation.cache_folder.cache_clear()
        folders[changed] = compilation.cache_folder(str(files["first"]), "package.first")
        files["other"].write_text("changed")
        compilation.cache_folder.cache_clear()
        same = compilation.cache_folder(str(files["first"]), "package.first")
        assert same == folders[changed]
    assert len(set(folders.values())) == 3


def test_without_a_writable_cache_the_temporary_folder_keeps_the_code(tmp_path, run, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/dev/null/cache")

    assert "kept" in run()
    assert [*(tmp_path / "temporary").rglob("*.nbc")]
    assert run() == ""


@pytest.mark.parametrize("name", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def test_the_present_folder_holds_no_code_that_is_loaded(name, tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv(name, "here")

    assert "no compiled code is kept in here: expected the full path" in run()
    assert not (tmp_path / "here").exists()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no modes")
@pytest.mark.parametrize("kind", [0o770, 0o707, "link"])
def test_code_is_not_loaded_from_a_folder_that_others_may_write(kind, tmp_path, run):
    run()
    (folder,) = (tmp_path / "cache").iterdir()
    if kind == "link":
        folder.rename(tmp_path / "other")
        folder.symlink_to(tmp_path / "other")
    else:
        folder.chmod(kind)

    printed = run()
    assert f"no compiled code is kept in {tmp_path / 'cache'}: expected the full path" in printed
    assert [*(tmp_path / "temporary").rglob("*.nbc")]


@pytest.mark.parametrize(
    "content", [b"", b"garbage", slice(0, 90)], ids=["empty", "garbage", "cut"]
)
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_damaged_code_is_compiled_again_and_said_in_one_line(ending, content, tmp_path, run):
    run()
    (path,) = (tmp_path / "cache").rglob(f"*.{ending}")
    path.write_bytes(path.read_bytes()[content] if isinstance(content, slice) else content)

    (line,) = run().splitlines()
    assert line.startswith(f"HybridTrack: element in {path.parent} is damaged (")
    assert run() == ""
