"""The radar data set: written twice, loaded, damaged."""

import json

import numpy as np
import pytest

from hybrid_env import ArgumentError
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.radars import SIGMA

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("radar")
    write_radar_data(found, seed=3, flights=20)
    return found


def test_the_same_seed_writes_the_same_bytes(folder, tmp_path):
    write_radar_data(tmp_path, seed=3, flights=20)
    names = sorted(file.name for file in folder.iterdir())

    assert names == [
        "README.md",
        "dataset.json",
        "flights.parquet",
        "measurements.parquet",
        "radars.parquet",
    ]
    assert all((folder / name).read_bytes() == (tmp_path / name).read_bytes() for name in names)


def test_the_split_and_the_noise_are_those_of_the_study(folder):
    data = load_radar_data(folder)
    assert [len(data.flights_of(split)) for split in ("training", "test")] == [6, 14]
    for split, tracks in data.tracks.items():
        for noise, of_noise in tracks.items():
            assert len(of_noise.times) == len(data.flights_of(split))
            error = (of_noise.measurements - of_noise.positions)[~np.isnan(of_noise.positions)]
            middle = np.quantile(np.abs(error), 0.5)
            assert middle == pytest.approx(
                0.674 * SIGMA if noise == "gaussian" else 0.969 * SIGMA,
                rel=0.1,
            )


@pytest.mark.parametrize("fault", ["missing", "changed", "format", "no json"])
def test_damaged_folders_are_refused(
    folder,
    tmp_path,
    fault,
):
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    about = json.loads((tmp_path / "dataset.json").read_text())
    if fault == "missing":
        (tmp_path / "radars.parquet").unlink()
    elif fault == "changed":
        (tmp_path / "measurements.parquet").write_bytes(b"PAR1")
    else:
        text = json.dumps(about | {"format": 99}) if fault == "format" else "[]"
        (tmp_path / "dataset.json").write_text(text)
    with pytest.raises(ArgumentError, match=r"has no radar data set|cannot be loaded"):
        load_radar_data(tmp_path)
