"""Compiled functions: an outdated cache is removed, and a compilation is announced."""

import os
import subprocess
import sys

import pytest

from hybrid_env.core.compilation import drop_stale_cache


@pytest.mark.parametrize(("changed", "kept"), [("package/kernel.py", 0), ("other/motion.py", 0), (None, 2)])
def test_a_newer_source_removes_the_cache(tmp_path, changed, kept):
    sources = [tmp_path / "package/kernel.py", tmp_path / "other/motion.py"]
    cached = [tmp_path / "package/__pycache__/a.nbi", tmp_path / "package/__pycache__/a.1.nbc"]
    for path in (*sources, *cached):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
        os.utime(path, (1000, 1000) if path in sources else (2000, 2000))
    if changed:
        os.utime(tmp_path / changed, (3000, 3000))
    drop_stale_cache(tmp_path / "package/__pycache__", sources)
    assert sum(path.exists() for path in cached) == kept


def test_a_missing_cache_does_not_raise(tmp_path):
    drop_stale_cache(tmp_path / "nowhere", [tmp_path])
    drop_stale_cache(None, [])


def test_only_the_first_process_announces_a_compilation(tmp_path):
    program = "import hybrid_env; env = hybrid_env.HybridTrackEnv(); env.reset(seed=0); env.step(0)"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    for announced in (1, 0):
        run = subprocess.run(
            [sys.executable, "-c", program], env=environment, text=True, capture_output=True, check=True
        )
        assert run.stderr.count("compiling once") == announced
        assert len(run.stderr.splitlines()) == announced
