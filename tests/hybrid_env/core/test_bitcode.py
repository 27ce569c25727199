"""Bitcode of kernels: all ids have it; without it, or with another's, kernels compile."""

import importlib
import lzma
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from hybrid_env.core import bitcode, compilation, kernels
from hybrid_env.registration import ENVIRONMENTS, make_track_vector_env


def small(address, command):
    return address + command


def raising(address, command):
    if address > 5:
        raise ValueError
    return command


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, beside an empty cache."""
    # Code with checked indices is never saved; numba reads its settings again when they change.
    monkeypatch.delenv("NUMBA_BOUNDSCHECK", raising=False)
    monkeypatch.setattr(compilation.config, "BOUNDSCHECK", None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    compilation.cache_folder.cache_clear()
    (tmp_path / "saved").mkdir()
    yield tmp_path / "saved"
    compilation.cache_folder.cache_clear()


def test_the_kernels_of_all_registered_ids_are_saved(monkeypatch, tmp_path):
    saved, needed = [], []
    tool = importlib.import_module("tools.bitcode")
    monkeypatch.setattr(tool, "config", SimpleNamespace(reload_config=lambda: None))
    monkeypatch.setattr(tool, "os", SimpleNamespace(environ={}))
    monkeypatch.setattr(bitcode, "save", lambda kernel, folder: saved.append(kernel.__name__))
    monkeypatch.setattr(kernels, "load", lambda name: needed.append(name) or 1)
    kernels._ready.cache_clear()
    try:
        tool.main(tmp_path)
        for env_id in ENVIRONMENTS:
            make_track_vector_env(env_id, 1)
    finally:
        kernels._ready.cache_clear()

    assert sorted(saved) == sorted(needed)


@pytest.mark.study
def test_saved_kernels_are_loaded(folder):
    root = Path(__file__).parents[3]
    subprocess.run([sys.executable, "-m", "tools.bitcode", str(folder)], check=True, cwd=root)

    names = [path.name.partition("-")[0] for path in folder.iterdir()]
    assert len(names) == 3
    assert all(bitcode.load(name, folder) for name in names)


def test_other_sources_or_checked_indices_compile(folder, monkeypatch):
    bitcode.save(small, folder)
    assert bitcode.load("small", folder)
    assert bitcode.load("other", folder) == 0
    with monkeypatch.context() as context:
        context.setattr(compilation.config, "BOUNDSCHECK", 1)
        assert bitcode.load("small", folder) == 0
    monkeypatch.setattr(bitcode, "FOLDER", folder)
    assert bitcode.load("small", folder) == 0


@pytest.mark.parametrize(
    "content", [b"", b"garbage", slice(0, 90)], ids=["empty", "garbage", "cut"]
)
def test_damaged_code_in_the_cache_is_made_again(content, folder):
    bitcode.save(small, folder)
    assert bitcode.load("small", folder)
    (kept,) = (folder.parent / "cache").rglob("small-*.o")
    code = kept.read_bytes()
    kept.write_bytes(code[content] if isinstance(content, slice) else content)

    assert bitcode.load("small", folder)
    assert kept.read_bytes() == code


def for_another_system(saved):
    module = bitcode.llvm.parse_bitcode(lzma.decompress(saved))
    module.triple = "arm64-apple-darwin"
    return lzma.compress(module.as_bitcode())


@pytest.mark.parametrize(
    ("kernel", "change"),
    [
        (raising, lambda saved: saved),
        (small, for_another_system),
        (small, lambda saved: lzma.compress(b"BC\xc0\xde" + bytes(64))),
        (small, lambda saved: saved[:20]),
        (small, lambda saved: b"garbage"),
    ],
    ids=["raises", "another system", "no bitcode", "cut", "garbage"],
)
def test_bitcode_that_cannot_be_used_compiles(kernel, change, folder):
    bitcode.save(kernel, folder)
    path = bitcode.path_of(kernel.__name__, folder)
    path.write_bytes(change(path.read_bytes()))

    assert bitcode.load(kernel.__name__, folder) == 0
