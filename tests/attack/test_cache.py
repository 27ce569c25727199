"""The cache of compiled functions under attack: any bytes in its files, and the functions return
the same.
"""

import runpy

import numba
import numpy as np
import pytest
from hostile_input import attack, counts, damaged
from hypothesis import strategies as st

PROGRAM = """
from hybrid_env.core.compilation import compiled

@compiled
def squared(x):
    return x * x

@compiled
def norm(x):
    return squared(x).sum()
"""


@pytest.mark.parametrize("cases", counts(3, 500))
def test_functions_with_a_damaged_cache_return_the_same(tmp_path, monkeypatch, cases):
    path = tmp_path / "program.py"
    cache = tmp_path / "cache"
    path.write_text(PROGRAM)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(cache))
    values = np.arange(9.0)

    def run():
        program = runpy.run_path(str(path), run_name="program")
        assert program["norm"](values) == 204.0
        assert program["squared"](values).sum() == 204.0

    run()
    intact = {file: file.read_bytes() for file in cache.rglob("*") if file.is_file()}
    contents = st.fixed_dictionaries(
        {},
        optional={file: damaged(data) for file, data in intact.items()},
    )

    def use(given):
        for file, data in (intact | given).items():
            file.write_bytes(data)
        run()

    attack(cases, contents, use)
