"""Families of the league: interquartile means, and the command that trains and resumes."""

import numpy as np
import pytest

from agents.cli import main
from agents.league import families, protocol, table
from agents.league.families import interquartile_mean
from agents.league.protocol import WORLDS
from agents.league.table import reward
from baselines.rules.decider import ANNOUNCED, UNKNOWN

HOME = "R = 0.1"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(protocol, "EPISODES", {ANNOUNCED: 8, UNKNOWN: 3})
    monkeypatch.setattr(families, "PROBED_TRACKS", 8)
    # They have more episodes.
    monkeypatch.setattr(table, "shipped_entries", list)
    few = {world: WORLDS[world] for world in (HOME, "R = 1", "unknown, R = 0.1")}
    for module in (protocol, table):
        monkeypatch.setattr(module, "WORLDS", few)
    groups = {
        env_id: [world for world in worlds if world in few]
        for env_id, worlds in protocol.GROUPS.items()
    }
    for module in (families, protocol):
        monkeypatch.setattr(module, "GROUPS", groups)


def test_interquartile_mean_is_that_of_the_middle_half_and_its_interval_resamples_each_world():
    rewards = np.array([[0.0, 10.0], [1.0, 11.0], [2.0, 12.0], [30.0, 13.0]])
    found = interquartile_mean(rewards)

    assert found.value == np.sort(rewards, axis=None)[2:6].mean()
    assert found.low < found.value < found.high
    # No spread within a world: no width.
    same = interquartile_mean(np.tile([0.3, 0.7], (5, 1)))
    assert (same.value, same.low, same.high) == pytest.approx((0.5, 0.5, 0.5))


def test_the_command_trains_a_family_and_goes_on_from_what_is_there(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    settings = (
        "algo: reward, n_timesteps: 100, n_envs: 4, hidden: 4, batch_size: 8, learning_rate: 0.01"
    )
    (tmp_path / "tiny.yml").write_text(f"default: {{{settings}}}")
    line = ["league", "tiny.yml", "--training-seeds", "2", "--out", "out", "--jobs", "1"]

    assert main(line) == 0
    first = capsys.readouterr().out
    assert "Trained families in HybridTrackPublished-v0" in first
    assert all(
        (tmp_path / "out" / f"{name}.png").stat().st_size > 10_000
        for name in ("league", "training")
    )
    entry = families.read_entry(tmp_path / "out" / "tiny.json")
    seeds = entry["worlds"][HOME]["seeds"]
    assert reward(entry, HOME).value == pytest.approx(np.mean(seeds), abs=1e-6)
    assert (
        f"{interquartile_mean(np.array(seeds)[:, None]).value:.3f}"
        in (tmp_path / "out" / "league.md").read_text()
    )
    monkeypatch.setattr(families, "play", lambda *_: pytest.fail("played again"))
    assert main(line) == 0
    assert families.read_entry(tmp_path / "out" / "tiny.json")["worlds"] == entry["worlds"]
    assert list(entry["worlds"]) == [HOME, "R = 1"]
