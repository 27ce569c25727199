"""The league: the same file twice, the tables, and files that were changed."""

import json

import numpy as np
import pytest

from agents import run_command
from hybrid_env import ArgumentError
from studies.league import table
from studies.league.__main__ import League
from studies.league.families import families_tables, interquartile_mean
from studies.league.protocol import THREE, collect, digest, play_world, read_entry
from studies.league.table import league_tables, reward, shipped_entries

RULE = """
import numpy as np
from hybrid_env import Layout

def first(rows):
    ratio = Layout.of_rows(rows).read(rows, "log_ratio")
    return np.where(Layout.of_rows(rows).read(rows, "ticks") >= 12, ratio.argmax(1) + 1, 0)
"""


def test_a_decider_gives_the_same_file_twice_and_its_rewards_are_those_of_its_estimates(tmp_path):
    (tmp_path / "mine.py").write_text(RULE)
    name = f"{tmp_path}/mine.py:first"
    worlds = ("R = 0.1", "unknown, R = 0.1")
    first, second = (
        collect(
            name,
            {
                world: play_world(
                    name,
                    world,
                    8,
                )
                for world in worlds
            },
        )
        for _ in range(2)
    )

    assert json.dumps(first) == json.dumps(second)
    assert (first["title"], first["kind"]) == ("first", "memoryless")
    assert "width=20" in first["worlds"]["unknown, R = 0.1"]["refused"]
    estimate = first["worlds"]["R = 0.1"]["metrics"]["reward"]["value"]
    assert estimate == pytest.approx(reward(first, "R = 0.1").value, abs=1e-6)


def test_a_file_that_was_changed_or_is_of_another_protocol_is_refused(tmp_path):
    entry = {"protocol": 1, "versions": {"hybrid-track": "0.0.1"}, "worlds": {}}
    path = tmp_path / "forged.json"
    for content, message in (
        (entry | {"digest": "0"}, "changed by hand"),
        (entry | {"digest": digest(entry)}, "protocol 1 of version 0.0.1"),
        ([1], "no file of the league"),
    ):
        path.write_text(json.dumps(content))
        with pytest.raises(ArgumentError, match=message):
            read_entry(path)


def test_the_tables_of_the_entries_are_those_of_the_page():
    page = (table.ENTRIES.parent / "README.md").read_text(encoding="utf-8")
    lines = page.partition("## Table")[2].partition("## Learned")[0].splitlines()
    published = [line.strip("| ").split(" | ") for line in lines if line.startswith("|")]
    # The agents of both tasks are in one file.
    names = {"shipped-threshold": "shipped", "shipped-margin": "shipped"}
    found = [row for part in league_tables(shipped_entries()) for row in part.to_numpy().tolist()]

    for row in published:
        if row[0] not in ("decider", "---|---|---|---|---|---|---|---|---"):
            row[0] = names.get(row[0], row[0])
            assert row in found or row[0].startswith("---"), row


def test_interquartile_mean_is_that_of_the_middle_half_and_its_interval_resamples_each_world():
    rewards = np.array([[0.0, 10.0], [1.0, 11.0], [2.0, 12.0], [30.0, 13.0]])
    found = interquartile_mean(rewards)

    assert found.value == np.sort(rewards, axis=None)[2:6].mean()
    assert found.low < found.value < found.high
    # No spread within a world: no width.
    same = interquartile_mean(np.tile([0.3, 0.7], (5, 1)))
    assert (same.value, same.low, same.high) == pytest.approx((0.5, 0.5, 0.5))


def test_the_quick_form_plays_and_trains_and_goes_on_from_what_is_there(tmp_path, capsys):
    flags = ["--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert (
        run_command(
            League,
            "league",
            flags,
        )
        == 0
    )
    assert "stated less right" in capsys.readouterr().out
    assert all((tmp_path / f"{name}.png").exists() for name in ("league", "training"))
    entry = read_entry(tmp_path / "tandem.json")
    seeds = entry["worlds"]["R = 0.1"]["seeds"]
    assert reward(entry, "R = 0.1").value == pytest.approx(np.mean(seeds), abs=1e-6)
    middle = interquartile_mean(np.array(seeds)[:, None]).value
    assert f"{middle:.3f} (" in families_tables([entry])[THREE]["R = 0.1"].iloc[0]
    written = {path: path.stat().st_mtime_ns for path in tmp_path.glob("agents/*/league.json")}

    assert (
        run_command(
            League,
            "league",
            [*flags, "--recipes", "tandem"],
        )
        == 0
    )
    assert read_entry(tmp_path / "tandem.json")["worlds"] == entry["worlds"]
    assert {path: path.stat().st_mtime_ns for path in written} == written
