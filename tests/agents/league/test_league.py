"""The league: the same file twice, and files that were changed."""

import json

import numpy as np
import pytest

from agents.cli import main
from agents.interface.parallel import Workers
from agents.league import protocol, table
from agents.league.protocol import EPISODES, WORLDS, play
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
    name = f"{folder}/mine.py:first"
    notes = []
    first, second = (play(name, Workers(), notes.append) for _ in range(2))

    assert json.dumps(first) == json.dumps(second)
    assert notes == [*protocol.WORLDS] * 2
    assert (first["title"], first["kind"]) == ("first", "memoryless")
    for world, one in first["worlds"].items():
        if world.startswith("unknown"):
            assert "width=20" in one["refused"]
        else:
            assert one["metrics"]["reward"]["value"] == pytest.approx(
                reward(first, world).value,
                abs=1e-6,
            )
    with pytest.raises(ArgumentError, match=r"mine.py line 10: RuntimeError: no idea"):
        play(f"{folder}/mine.py:broken", Workers(), notes.append)


def test_the_command_shows_files_and_refuses_those_that_were_changed(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    # They have more episodes.
    monkeypatch.setattr(table, "shipped_entries", list)

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
    # Refused before any work, and no folder is left.
    for name in ("mine.py", "runs/none"):
        assert main(["league", "mine.py:first", name, "--out", "none"]) == 2
        assert f"decider='{name}' is not allowed" in capsys.readouterr().err
    assert not (folder / "none").exists()


FORGED = {
    "title": ["", " beam", "two\nlines", 5, None],
    "kind": ["oracle", 5, None],
    "worlds": [
        5,
        {"Mars": {"refused": "no"}},
        {"R = 0.1": 5},
        {"R = 0.1": {"refused": 5}},
        {"R = 0.1": {}},
    ],
    "cost": [
        5,
        {},
        {
            "calibration": None,
            "microseconds": -1.0,
            "seconds": 1.0,
        },
    ],
}
FORGED_PLAY = {
    "threshold": ["a", None, True],
    "metrics": [5, {}, {"reward": {"value": "a"}}, {"reward": 5}],
    "rewards": [
        5,
        "?",
        "AAAA",
        protocol.pack(np.full(8, 9.99)),
        protocol.pack(np.full(8, np.nan)),
        protocol.pack(np.full(8, 0.1)),
        protocol.pack(np.zeros(7)),
    ],
    "seeds": [5, ["a"], [9.99], [0.1]],
    "more": [5],
}


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, value) for name, values in FORGED.items() for value in values],
)
def test_a_forged_file_is_refused_in_one_line(entry, tmp_path, name, value):
    refused(entry | {name: value}, tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, value) for name, values in FORGED_PLAY.items() for value in values],
)
def test_a_forged_world_is_refused_in_one_line(entry, tmp_path, name, value):
    refused(
        entry | {"worlds": {"R = 0.1": entry["worlds"]["R = 0.1"] | {name: value}}},
        tmp_path,
    )


@pytest.fixture(scope="module")
def entry():
    """An entry that may be read."""
    names = {metric.name: {"value": None} for metric in protocol.world_task("R = 0.1").metrics}
    content = {
        "threshold": 0.0,
        "metrics": names
        | {
            "reward": {
                "value": 0.5,
                "low": 0.4,
                "high": 0.6,
            }
        },
        "rewards": protocol.pack(np.full(8, 0.5)),
    }
    return protocol.make_entry("mine.py:rule", "rule", "memoryless", {"R = 0.1": content})


def refused(content, folder):
    path = folder / "forged.json"
    path.write_text(json.dumps(_signed(content)))
    with pytest.raises(ArgumentError, match="a file as the league writes it") as error:
        protocol.read_entry(path)
    assert "\n" not in str(error.value)


def test_a_file_with_a_title_of_the_package_or_of_another_file_is_refused(
    entry,
    tmp_path,
    monkeypatch,
    capsys,
):
    own, other = (tmp_path / name for name in ("own.json", "other.json"))
    own.write_text(json.dumps(entry))

    assert protocol.read_entry(own) == entry
    ours = _signed(entry | {"decider": "beam", "title": "beam"})
    monkeypatch.setattr(table, "shipped_entries", lambda: [ours])
    line = ["league", "--out", str(tmp_path / "out"), "--table", str(own), str(other)]
    for title, owner in (
        ("beam", "the package"),
        ("rule", "another file"),
    ):
        other.write_text(json.dumps(_signed(entry | {"title": title, "kind": "recurrent"})))
        assert main(line) == 2
        assert f"a title that {owner} has not; this one is '{title}'" in capsys.readouterr().err
    for same in (entry, ours):
        other.write_text(json.dumps(same))
        assert main(line) == 0


def test_own_deciders_with_titles_of_the_package_or_of_others_are_called_by_their_paths(
    folder,
    tmp_path,
    monkeypatch,
):
    monkeypatch.setattr(table, "shipped_entries", list)
    monkeypatch.chdir(folder)
    (folder / "other.py").write_text(RULE + "\nfirst.title = 'other'\n")
    (folder / "same.py").write_text(RULE)

    assert (
        main(["league", "mine.py:first", "other.py:first", "same.py:first", "--out", str(tmp_path)])
        == 0
    )
    titles = {protocol.read_entry(path)["title"] for path in tmp_path.glob("*.json")}
    assert titles == {"mine.py:first", "other", "same.py:first"}


def _signed(found):
    content = {key: value for key, value in found.items() if key != "digest"}
    return content | {"digest": protocol._digest(content)}


def test_the_entries_of_the_package_are_of_this_protocol(monkeypatch):
    for module in (protocol, table):
        monkeypatch.setattr(module, "WORLDS", WORLDS)
    monkeypatch.setattr(protocol, "EPISODES", EPISODES)
    entries = shipped_entries()
    titles = [one["title"] for one in entries]

    assert {"ATE (SPRT)", "MSPRT", "shipped", "ppo", "beam"} <= set(titles)
    assert len(set(titles)) == len(titles)
    assert all(set(one["worlds"]) == set(WORLDS) for one in entries)
    # It plays in both tables.
    both = sum(one["title"] == "shipped" for one in entries)
    assert len(league_markdown(entries).splitlines()) == 5 + len(entries) + both
    (legend,) = league_figure(entries).legends
    assert len(legend.get_texts()) == len(entries)
