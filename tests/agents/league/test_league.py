"""The league: the same file twice, and files that were changed."""

import json

import pytest

from agents.cli import main
from agents.interface.parallel import Workers
from agents.league import protocol, table
from agents.league.protocol import WORLDS, play
from agents.league.table import league_figure, league_markdown, reward, shipped_entries
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from hybrid_env import ArgumentError

RULE = """
import numpy as np
from hybrid_env.observation import Layout

def first(rows):
    ratio = Layout.of_rows(rows).read(rows, "log_ratio")
    return np.where(Layout.of_rows(rows).read(rows, "ticks") >= 12, ratio.argmax(1) + 1, 0)

def broken(rows):
    raise RuntimeError("no idea")
"""


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(protocol, "EPISODES", {ANNOUNCED: 8, UNKNOWN: 3})
    few = {world: WORLDS[world] for world in ("R = 0.1", "5 % outliers", "unknown, R = 0.1")}
    for module in (protocol, table):
        monkeypatch.setattr(module, "WORLDS", few)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("league")
    (path / "mine.py").write_text(RULE)
    return path


def test_a_decider_gives_the_same_file_twice_and_its_rewards_are_those_of_its_estimates(folder):
    name, notes = f"{folder}/mine.py:first", []
    first, second = (play(name, Workers(), notes.append) for _ in range(2))
    assert json.dumps(first) == json.dumps(second)
    assert notes == [*protocol.WORLDS] * 2
    assert (first["title"], first["kind"]) == ("first", "memoryless")
    for world, one in first["worlds"].items():
        if world.startswith("unknown"):
            assert "width=20" in one["refused"]
        else:
            assert one["metrics"]["reward"]["value"] == pytest.approx(reward(first, world).value, abs=1e-6)
    with pytest.raises(ArgumentError, match=r"mine.py line 10: RuntimeError: no idea"):
        play(f"{folder}/mine.py:broken", Workers(), notes.append)


def test_the_command_shows_files_and_refuses_those_that_were_changed(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(table, "shipped_entries", list)  # they have more episodes
    assert main(["league", "mine.py:first", "--out", "out"]) == 0
    shown = capsys.readouterr().out
    assert "first (memoryless) in every world" in shown
    assert "League" in shown
    file = folder / "out" / "first.json"
    assert main(f"league --table {file} --out out".split()) == 0
    assert "first" in (folder / "out" / "league.md").read_text()
    assert (folder / "out" / "league.png").stat().st_size > 10_000
    found = json.loads(file.read_text())
    found["worlds"]["R = 0.1"]["metrics"]["reward"]["value"] += 0.1
    for content, message in (
        (found, "this one was changed by hand"),
        (_signed(found | {"protocol": 0}), "protocol 1 .*; this one is protocol 0"),
        (_signed(found | {"versions": {"hybrid-track": "0.0.1"}}), "protocol 1 of version 0.0.1"),
        ([1], "a file of the league"),
    ):
        file.write_text(json.dumps(content))
        with pytest.raises(ArgumentError, match=message):
            protocol.read_entry(file)
        assert main(f"league --table {file} --out out".split()) == 2
    monkeypatch.setattr(protocol, "play", lambda *_: pytest.fail("played"))
    for name in ("mine.py", "runs/none"):  # refused before any work, and no folder is left
        assert main(["league", "mine.py:first", name, "--out", "none"]) == 2
        assert f"decider='{name}' is not allowed" in capsys.readouterr().err
    assert not (folder / "none").exists()


def _signed(found):
    content = {key: value for key, value in found.items() if key != "digest"}
    return content | {"digest": protocol._digest(content)}


def test_the_entries_of_the_package_are_of_this_protocol(monkeypatch):
    monkeypatch.setattr(table, "WORLDS", WORLDS)
    entries = shipped_entries()
    titles = [one["title"] for one in entries]
    assert {"ATE (SPRT)", "MSPRT", "shipped", "ppo", "beam"} <= set(titles)
    assert len(set(titles)) == len(titles)
    assert all(set(one["worlds"]) == set(WORLDS) for one in entries)
    both = sum(one["title"] == "shipped" for one in entries)  # it plays in both tables
    assert len(league_markdown(entries).splitlines()) == 5 + len(entries) + both
    (legend,) = league_figure(entries).legends
    assert len(legend.get_texts()) == len(entries)
