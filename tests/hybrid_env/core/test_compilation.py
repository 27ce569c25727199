"""The cache of compiled functions: announced, outdated, damaged, missing and not writable."""

import os
import re
import runpy
from pathlib import Path

import numba
import numpy as np
import pytest

import hybrid_env
from hybrid_env.core.compilation import drop_stale_files


@pytest.mark.parametrize(
    ("changed", "kept"),
    [
        (True, 0),
        (False, 2),
    ],
)
def test_a_newer_source_removes_the_cache(tmp_path, changed, kept):
    year = 366 * 24 * 3600.0
    newest = max(path.stat().st_mtime for path in Path(hybrid_env.__file__).parent.rglob("*.py"))
    for name in ("kernel.f-1.py311.nbi", "kernel.f-1.py311.1.nbc"):
        (tmp_path / name).write_text("")
        os.utime(
            tmp_path / name,
            (newest, newest - year if changed else newest + year),
        )
    drop_stale_files(str(tmp_path), "hybrid_env")

    assert len(list(tmp_path.iterdir())) == kept


UNWRITABLE = ("", "/dev/null/cache", "/proc/cache")
PROGRAM = """
import numpy as np
from hybrid_env.core.compilation import compiled, prepare

@compiled
def element(x, i):
    return x[i] + 1.0

@compiled
def other(x, i):
    return x[i] + 2.0

@compiled
def of_both(x, i):
    return element(x, i) + other(x, i)

prepare(element, np.ones(3), 1)
"""
# Functions of the program: one is prepared, one calls the others, one is also called from Python.
COMPILED = 3


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs the program as a new process would, and counts its
    announcements.
    """
    path = tmp_path / "program.py"
    path.write_text(PROGRAM)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))

    def run(index=1):
        module = runpy.run_path(str(path), run_name="program")
        assert module["element"](np.ones(3), index) == 2.0
        assert module["of_both"](np.ones(3), index) == 5.0
        assert module["other"](np.ones(3), index) == 3.0
        lines = capsys.readouterr().err.splitlines()
        until = "not kept, as" if numba.config.CACHE_DIR in UNWRITABLE else "kept for"
        said = (
            r"compiling program.\w+ \(number \d+; most commands need 1 to 5\), up to 15 s,"
            rf" {until} "
        )
        assert all(re.search(said, line) for line in lines)
        return len(lines)

    return run


def test_only_the_first_process_announces_a_compilation(run):
    assert [run(), run()] == [COMPILED, 0]


def _empty(path):
    path.write_bytes(b"")


def _truncate(path):
    path.write_bytes(path.read_bytes()[:-100])


# Without the checksum, damaged machine code would be executed.
def _flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


def _replace_by_text(path):
    path.write_text("not a cache\n")


def _take_that_of_another_function(path):
    others = [other for other in path.parent.glob(f"*{path.suffix}") if other != path]
    path.write_bytes(others[0].read_bytes())


DAMAGES = [_empty, _truncate, _flip, _replace_by_text, Path.unlink]


@pytest.mark.parametrize("name", ["element", "other", "of_both"])
@pytest.mark.parametrize("damage", [*DAMAGES, _take_that_of_another_function])
@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_damaged_cache_is_replaced(tmp_path, run, suffix, damage, name):
    run()
    (path,) = (tmp_path / "cache").rglob(f"program.{name}-*.{suffix}")
    damage(path)

    assert [run(), run()] == [1, 0]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_cache_of_damaged_files_alone_is_replaced(tmp_path, run, damage):
    run()
    files = [
        path
        for path in (tmp_path / "cache").rglob("*")
        if path.is_file() and path.suffix != ".lock"
    ]

    assert {path.suffix for path in files} == {".nbi", ".nbc", ".checksums"}
    for path in files:
        damage(path)
    assert [run(), run()] == [COMPILED, 0]


def test_a_cache_that_cannot_be_removed_is_named_in_one_line(tmp_path, run):
    run()
    (path,) = (tmp_path / "cache").rglob("program.element-*.nbi")
    path.unlink()
    path.mkdir()
    with pytest.raises(
        OSError,
        match=r"^the compilation cache .*program.element is damaged: remove it, or set",
    ):
        run()


@pytest.mark.parametrize("folder", UNWRITABLE[1:])
def test_a_cache_that_cannot_be_written_is_not_used(tmp_path, run, monkeypatch, folder):
    monkeypatch.setattr(numba.config, "CACHE_DIR", folder)
    for name in ("XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, folder)
    (tmp_path / "__pycache__").write_text("a file where numba would make a folder")

    assert [run(), run()] == [COMPILED, COMPILED]


def test_checked_indices_raise(tmp_path, run, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(numba.config, "BOUNDSCHECK", 1)
    with pytest.raises(IndexError):
        run(index=5)

    assert not list(tmp_path.rglob("*.nb[ic]"))
