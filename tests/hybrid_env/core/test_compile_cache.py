"""A changed source drops the compiled functions that it may be part of, and nothing else does."""

import os

import pytest

from hybrid_env.core.compile_cache import drop_stale_cache


@pytest.mark.parametrize(("changed", "kept"), [("package/kernel.py", 0), ("other/motion.py", 0), (None, 2)])
def test_a_newer_source_drops_the_cache(tmp_path, changed, kept):
    for name in (
        "package/kernel.py",
        "other/motion.py",
        "package/__pycache__/a.nbi",
        "package/__pycache__/a.1.nbc",
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
        os.utime(path, (1000, 1000) if name.endswith(".py") else (2000, 2000))
    if changed:
        os.utime(tmp_path / changed, (3000, 3000))
    drop_stale_cache(tmp_path / "package/__pycache__", [tmp_path / "package", tmp_path / "other"])
    assert len(list((tmp_path / "package/__pycache__").iterdir())) == kept


def test_a_package_without_a_cache_is_left_alone(tmp_path):
    drop_stale_cache(tmp_path / "nowhere", [tmp_path])
