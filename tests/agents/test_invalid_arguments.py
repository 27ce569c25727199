"""The command line: every invalid value of a flag is rejected in one line, and nothing is
written.
"""

import shlex
from dataclasses import fields

import pytest

from agents.cli import main
from agents.commands.compare import Compare
from agents.commands.evaluate import Evaluate
from agents.commands.play import Play
from agents.commands.score import Score
from agents.commands.track import Track
from agents.commands.train import Train

WORLD_COMMANDS = ("compare", "train", "evaluate", "play --out x.gif")
QUICKEST = "--env HybridTrackQuickest-v0"
INVALID_WORLD_ARGUMENTS = [
    ("--env NoSuch-v0", "env='NoSuch-v0'"),
    ("--env CartPole-v1", "env='CartPole-v1'"),
    ("--scheme Q9", "scheme='Q9'"),
    ("--scheme ''", "scheme=''"),
    ("--scheme L50r0", "scheme='L50r0'"),
    ("--scheme S0", "scheme='S0'"),
    ("--radii 0", "radii=(0.0,)"),
    ("--radii 5 nan", "radii=(5.0, nan)"),
    ("--radii", "radii=()"),
    ("--bank silver", "silver"),
    ("--speed 0", "speed=0.0"),
    ("--heading inf", "heading=inf"),
    ("--tau -1", "tau=-1.0"),
    ("--process-variance -1", "process_variance=-1.0"),
    ("--object-variance -1", "object_variance=-1.0"),
    ("--measurement-variance 0", "measurement_variance=0.0"),
    ("--measurement-variance nan", "measurement_variance=nan"),
    ("--measurement-variance loud", "--measurement-variance"),
    ("--delay-cost -1", "delay_cost=-1.0"),
    ("--noise outliers", "noise='outliers'"),
    ("--missed 1", "missed=1.0"),
    ("--sensors 0.1 near", "'near'"),
    ("--initial-error -1", "initial_error=-1.0"),
    ("--actions some", "some"),
    ("--likelihood levy", "likelihood='levy'"),
    ("--correctness rough", "correctness"),
    ("--undecided shrug", "undecided"),
    ("--reset-covariance 2", "2"),
    ("--follow both", "follow"),
    ("--evidence 1", "evidence=1.0"),
    ("--observation nothing", "observation"),
    ("--recalculation --follow bank", "recalculation=True"),
    ("--refine-radius", "refine_radius=True"),
    ("--ticks 5", "ticks=5"),
    ("--durations 'geometric 9'", "durations='geometric 9'"),
    ("--start late", "start"),
    ("--change-cost 1", "change_cost=1.0"),
    ("--hazard 0.1", "hazard=0.1"),
    ("--seed -1", "seed=-1"),
    ("--seed half", "half"),
    ("--tua 3", "--tua"),
]
INVALID_ARGUMENTS = [
    # One command after the other.
    (f"{WORLD_COMMANDS[k % len(WORLD_COMMANDS)]} {flags}", message)
    for k, (flags, message) in enumerate(INVALID_WORLD_ARGUMENTS)
] + [
    ("", "Expected one of"),
    ("divine", "divine"),
    ("compare --episodes 0", "episodes=0"),
    ("compare --steps 0", "steps=0"),
    ("compare --training-seeds 0", "training-seeds=0"),
    ("compare --selection-episodes 0", "selection-episodes=0"),
    ("compare --deciders", "deciders=()"),
    ("compare --deciders ate ate", "deciders=('ate', 'ate')"),
    ("compare --deciders ate oracle", "deciders='oracle'"),
    ("compare --out bad.txt", "out="),
    ("compare --accuracy 1", "accuracy=1.0"),
    ("compare --curves maybe", "maybe"),
    ("train --steps 0", "steps=0"),
    ("train --out /dev/null/x", "out="),
    ("train --recipe stew", "recipe='stew'"),
    ("train --recipe anchor --set tracks=3", "hyper-parameter='tracks'"),
    ("train --set n_envs", "set='n_envs'"),
    ("train --set n_envs=[", "set='n_envs=['"),
    ("train --set algo=magic", "algo='magic'"),
    ("train --set policy_kwargs.squash_output=true", "policy_kwargs="),
    ("compare --agents ppo ppo", "agents=('ppo', 'ppo')"),
    ("compare --agents ate", "agents='ate'"),
    ("compare --agents nowhere", "agents='nowhere'"),
    ("train --seed 5000000000", "seed=5000000000"),
    ("evaluate --scheme 'random 99999999999999999999x5'", "segments="),
    ("train --save-every 0", "save-every=0.0"),
    ("train --resume nowhere", "resume='nowhere'"),
    ("train --resume nowhere --seed 3", "resume='nowhere'"),
    ("train --out .", "out='.'"),
    ("evaluate ate:2", "alpha=2.0"),
    ("evaluate fixed:2.5", "decider='fixed:2.5'"),
    ("evaluate --episodes 0", "episodes=0"),
    ("evaluate ate ate", "deciders=('ate', 'ate')"),
    ("evaluate ate:1e-3 --shifted", "deciders='ate:1e-3'"),
    ("evaluate --shifted --seed 1000000000", "seed=1000000000"),
    ("evaluate --drawn -1", "drawn=-1"),
    ("evaluate --noises loud", "noises='loud'"),
    ("play --out x.mp4", "out='x.mp4'"),
    ("play --out x.gif --record x.txt", "record='x.txt'"),
    ("track", "files=()"),
    ("track nofile.csv", "file='nofile.csv'"),
    ("track good.csv --lengths 1 2", "lengths="),
    ("track good.csv --decider nosuch", "decider='nosuch'"),
    ("track good.csv --decider ate", "--lengths"),
    ("track good.csv --lengths 2 --decider beam", "decider='beam'"),
    ("track good.csv --picture perhaps", "perhaps"),
    ("track good.csv --html perhaps", "perhaps"),
    ("track good.csv --start 0 0 0", "start"),
    ("track good.csv --columns x=z y=y", "columns='z'"),
    ("track good.csv --object who", "object='who'"),
    ("track good.csv --unit ''", "unit=''"),
    ("track good.csv --time-unit weeks", "time_unit='weeks'"),
    ("track good.csv --radar 30", "radar='30'"),
    ("track good.csv --gap 0", "gap=0.0"),
    ("track good.csv --jobs 0", "jobs=0"),
    ("track good.csv --overwrite perhaps", "perhaps"),
    ("track good.csv ./good.csv", "both have the output folder"),
    (f"compare {QUICKEST} --deciders ate", "deciders='ate'"),
    (f"compare {QUICKEST} --episodes 999999999", "episodes=999999999"),
    (f"compare {QUICKEST} --accuracy 0.9", "accuracy=0.9"),
    (f"evaluate {QUICKEST} ate", "decider='ate'"),
    (f"evaluate {QUICKEST} threshold:2", "threshold=2.0"),
    (f"evaluate {QUICKEST} beam:much", "decider='beam:much'"),
    (f"play --out x.gif {QUICKEST} --decider beam --order often", "order='often'"),
    (f"evaluate {QUICKEST} --drawn 2", "drawn=2"),
    ("evaluate threshold", "decider='threshold'"),
]
INVALID_ARGUMENTS += [
    (f"score {files} {flags}", message)
    for files, flags, message in (
        ("", "", "files="),
        ("good.csv", "", "the truth and at least one more"),
        ("good.csv bad.txt", "--columns time=1 mode=2", "bad.txt, line 1"),
        ("good.csv good.csv", "", "no column of times (its columns are x, y)"),
        ("good.csv good.csv x/good.csv", "", "different names"),
        ("good.csv good.csv", "--columns z=1", "columns='z=1'"),
        ("good.csv good.csv", "--columns time=1 mode=3", "columns='3'"),
        ("good.csv good.csv", "--columns time=1 --object 7", "object='7'"),
        ("good.csv good.csv", "--columns time=1 --time-unit h2", "time_unit='h2'"),
        ("good.csv good.csv", "--columns time=1 mode=2 --normal x", "normal='x'"),
        ("good.csv good.csv", "--per year", "year"),
        ("good.csv good.csv", "--out no/s.json", "out='no/s.json'"),
        ("good.csv good.csv", "--picture no/s.png", "picture='no/s.png'"),
    )
]
INVALID_ARGUMENTS += [
    (f"{command} --error {rate}", f"error='{rate}'")
    for command in ("evaluate ate", "play --out x.gif", "track good.csv")
    for rate in ("2", "auto", "2/100")
]
INVALID_ARGUMENTS += [
    (f"{command} {flags}", message)
    for command in ("compare", "evaluate")
    for flags, message in (
        ("--jobs 0", "jobs=0"),
        ("--engine spark", "spark"),
    )
]


@pytest.mark.parametrize(("line", "message"), INVALID_ARGUMENTS)
def test_invalid_arguments_are_rejected_with_one_line_and_exit_code_2(
    line,
    message,
    capsys,
    tmp_path,
    monkeypatch,
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.txt").write_bytes(b"\x00\x01not a table")
    (tmp_path / "good.csv").write_text("x,y\n0,0\n1,1\n")
    before = sorted(tmp_path.rglob("*"))

    assert main(shlex.split(line)) == 2
    captured = capsys.readouterr()
    # The first time only.
    announced = "HybridTrack: compiling "
    lines = [line for line in captured.err.splitlines() if not line.startswith(announced)]
    assert len(lines) == 1
    assert lines[0].startswith("hybridtrack: ")
    assert message in lines[0] or message.replace("_", "-") in lines[0]
    assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_every_flag_has_an_invalid_value_in_the_list():
    lines = " ".join(line for line, _ in INVALID_ARGUMENTS)
    positional = {
        (Track, "files"),
        (Score, "files"),
        (Evaluate, "deciders"),
    }
    for kind in (Compare, Train, Evaluate, Play, Track, Score):
        for name in {field.name for field in fields(kind)} - {"trust"}:
            assert (kind, name) in positional or f"--{name.replace('_', '-')}" in lines, (
                kind,
                name,
            )
