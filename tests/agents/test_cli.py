"""The command line: invalid arguments are rejected, and every command runs."""

import json

import pytest

from agents.cli import main
from agents.evaluation import shifted_worlds
from hybrid_env import WorldOptions

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
    ("--measurement-variance 0", "measurement_variance=0.0"),
    ("--measurement-variance nan", "measurement_variance=nan"),
    ("--measurement-variance loud", "--measurement-variance"),
    ("--delay-cost -1", "delay_cost=-1.0"),
    ("--noise outliers", "noise='outliers'"),
    ("--missed 1", "missed=1.0"),
    ("--likelihood levy", "likelihood='levy'"),
    ("--correctness rough", "correctness"),
    ("--undecided shrug", "undecided"),
    ("--reset-covariance 2", "2"),
    ("--follow both", "follow"),
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
    (f"{command} {flags}", message)
    for command in ("compare", "train", "tune", "evaluate", "play --out x.gif")
    for flags, message in INVALID_WORLD_ARGUMENTS
] + [
    ("", "Expected one of"),
    ("divine", "divine"),
    ("compare --episodes 0", "episodes=0"),
    ("compare --episodes many", "many"),
    ("compare --steps 0", "steps=0"),
    ("compare --training-seeds 0", "training-seeds=0"),
    ("compare --selection-episodes 0", "selection-episodes=0"),
    ("compare --deciders", "deciders=()"),
    ("compare --deciders ate ate", "deciders=('ate', 'ate')"),
    ("compare --deciders ate oracle", "deciders='oracle'"),
    ("compare --out bad.txt", "out="),
    ("compare --accuracy 1", "accuracy=1.0"),
    ("compare --curves maybe", "maybe"),
    ("compare --accuracy nan", "accuracy=nan"),
    ("limits --episodes 1", "episodes=1"),
    ("limits --seed 1000000000", "seed=1000000000"),
    ("limits --out bad.txt", "out="),
    ("limits --env HybridTrack-v0", "env='HybridTrack-v0'"),
    ("evaluate msprt:0", "alpha=0.0"),
    ("evaluate gap:40", "gap=40.0"),
    ("evaluate ml:0.5", "decider='ml:0.5'"),
    ("evaluate bayes:-1", "cost=-1.0"),
    ("train --steps 0", "steps=0"),
    ("train --out /dev/null/x", "out="),
    ("train --recipe stew", "recipe='stew'"),
    ("train --recipe bad.txt", "recipe='bad.txt'"),
    ("train --recipe good.csv", "recipe='good.csv'"),
    ("train --recipe anchor --set tracks=3", "hyper-parameter='tracks'"),
    ("train --set n_envs", "set='n_envs'"),
    ("train --set n_envs=[", "set='n_envs=['"),
    ("train --set algo=magic", "algo='magic'"),
    ("train --set policy=Nonsense", "policy='Nonsense'"),
    ("train --set n_envs.x=3", "set='n_envs.x=3'"),
    ("train --set policy_kwargs.squash_output=true", "policy_kwargs="),
    ("train --set policy_kwargs.depth=3", "policy_kwargs="),
    ("train --set observe=[smell]", "observe='smell'"),
    ("train --recipe anchor --set worlds=[]", "worlds=()"),
    ("train --recipe anchor --set worlds=[3]", "worlds=[3]"),
    ("compare --agents ppo ppo", "agents=('ppo', 'ppo')"),
    ("compare --agents ate", "agents='ate'"),
    ("compare --agents nowhere", "agents='nowhere'"),
    ("train --seed 5000000000", "seed=5000000000"),
    ("evaluate --scheme 'random 99999999999999999999x5'", "segments="),
    ("evaluate ''", "decider="),
    ("compare --flights --tier X", "tier='X'"),
    ("compare --flights --source nowhere", "source=nowhere"),
    ("compare --source nowhere", "source='nowhere'"),
    ("compare --tier A", "tier="),
    ("compare --seed 1000000000", "seed=1000000000"),
    ("train --save-every 0", "save-every=0.0"),
    ("train --resume nowhere", "resume='nowhere'"),
    ("train --resume nowhere --seed 3", "resume='nowhere'"),
    ("train --out .", "out='.'"),
    ("evaluate oracle", "decider='oracle'"),
    ("evaluate ate:2", "alpha=2.0"),
    ("evaluate fixed:2.5", "decider='fixed:2.5'"),
    ("evaluate --episodes 0", "episodes=0"),
    ("evaluate ate ate", "deciders=('ate', 'ate')"),
    ("evaluate ate:1e-3 --shifted", "deciders='ate:1e-3'"),
    ("evaluate ate nosuch", "decider='nosuch'"),
    ("evaluate --shifted --seed 1000000000", "seed=1000000000"),
    ("evaluate --drawn -1", "drawn=-1"),
    ("evaluate --noises loud", "noises='loud'"),
    ("evaluate --drawn 2 --beyond 0.5", "beyond=0.5"),
    ("evaluate --out nowhere/x.json", "out='nowhere/x.json'"),
    ("play --out x.mp4", "out='x.mp4'"),
    ("play --out x.gif --episodes 0", "episodes=0"),
    ("play --out x.gif --decider oracle", "decider='oracle'"),
    ("play --out x.gif --record x.txt", "record='x.txt'"),
    ("reproduce golubkov2019", "golubkov2019"),
    ("reproduce golubkov2018 golubkov2018", "papers=('golubkov2018', 'golubkov2018')"),
    ("reproduce --runs 1", "runs=1"),
    ("reproduce --seed -1", "seed=-1"),
    ("reproduce --physics maybe", "maybe"),
    ("reproduce golubkov2018 --physics", "novospaskyi, with --physics"),
    ("reproduce --out bad.txt", "out="),
    ("track", "files=()"),
    ("track nofile.csv", "file='nofile.csv'"),
    ("track bad.txt", "bad.txt"),
    ("track good.csv --lengths 1 2", "lengths="),
    ("track good.csv --lengths 2 0", "lengths"),
    ("track good.csv --decider nosuch", "decider='nosuch'"),
    ("track good.csv --decider ate", "--lengths"),
    ("track good.csv --lengths 2 --decider beam", "decider='beam'"),
    ("track good.csv --radii 0", "radii=(0.0,)"),
    ("track good.csv --tau 0", "tau=0.0"),
    ("track good.csv --process-variance -1", "process_variance=-1.0"),
    ("track good.csv --measurement-variance 0", "measurement_variance=0.0"),
    ("track good.csv --durations long", "durations='long'"),
    ("track good.csv --bank published", "bank='published'"),
    ("track good.csv --picture perhaps", "perhaps"),
    ("track good.csv --html perhaps", "perhaps"),
    ("track good.csv --undecided shrug", "undecided"),
    ("track good.csv --start 0 0 0", "start"),
    ("track good.csv --out bad.txt", "bad.txt"),
    ("track good.csv --columns x", "columns='x'"),
    ("track good.csv --columns x=1 x=2", "columns='x=2'"),
    ("track good.csv --columns x=z y=y", "columns='z'"),
    ("track good.csv --object who", "object='who'"),
    ("track good.csv --unit ''", "unit=''"),
    ("track good.csv --time-unit weeks", "time_unit='weeks'"),
    ("track good.csv --gap 0", "gap=0.0"),
    ("track good.csv --jobs 0", "jobs=0"),
    ("track good.csv --overwrite perhaps", "perhaps"),
    ("track good.csv ./good.csv", "both have the output folder"),
    ("tune --recipe nosuch", "recipe='nosuch'"),
    ("tune --search n_epochs=2", "search='n_epochs=2'"),
    ("tune --set n_envs", "set='n_envs'"),
    ("tune --trials 0", "trials=0"),
    ("tune --steps 0", "steps=0"),
    ("tune --out bad.txt", "out="),
]
INVALID_ARGUMENTS += [
    (f"{command} {flags}", message)
    for command in ("limits", "compare", "evaluate", "reproduce", "tune")
    for flags, message in (("--jobs 0", "jobs=0"), ("--engine spark", "spark"))
]


@pytest.mark.parametrize(("line", "message"), INVALID_ARGUMENTS)
def test_invalid_arguments_are_rejected_with_one_line_and_exit_code_2(
    line, message, capsys, tmp_path, monkeypatch
):
    import shlex

    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.txt").write_bytes(b"\x00\x01not a table")
    (tmp_path / "good.csv").write_text("x,y\n0,0\n1,1\n")
    before = sorted(tmp_path.rglob("*"))
    assert main(shlex.split(line)) == 2
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("hybridtrack: ")
    assert message in lines[0] or message.replace("_", "-") in lines[0]
    assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_every_flag_of_every_command_has_an_invalid_value_in_the_list():
    from dataclasses import fields

    from agents.comparison.command import Compare
    from agents.evaluation.command import Evaluate
    from agents.limits.command import Limits
    from agents.playing.command import Play
    from agents.recordings.command import Track
    from agents.reproduction.command import Reproduce
    from agents.training.command import Train
    from agents.tuning.command import Tune

    for command, kinds in {
        "compare": (Compare,), "train": (Train,), "evaluate": (Evaluate,), "play": (Play,),
        "reproduce": (Reproduce,), "track": (Track,), "limits": (Limits,), "tune": (Tune,),
    }.items():  # fmt: skip
        lines = " ".join(line for line, _ in INVALID_ARGUMENTS if line.startswith(command))
        for kind in kinds:
            for field in fields(kind):
                positional = (kind, field.name) in {
                    (Track, "files"),
                    (Evaluate, "deciders"),
                    (Reproduce, "papers"),
                }
                assert positional or f"--{field.name.replace('_', '-')}" in lines, (command, field.name)


def unwrapped(capsys):
    """The output as one line; long paths may be wrapped anywhere."""
    return " ".join(capsys.readouterr().out.split())


def test_help_is_printed_with_exit_code_0(capsys):
    assert main(["--help"]) == 0
    assert "compare" in capsys.readouterr().out


def test_evaluate_prints_and_writes_its_results(capsys, tmp_path):
    out = tmp_path / "ate.json"
    assert main(["evaluate", "ate:0.01", "--episodes", "20", "--scheme", "S20 L30r5", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "accuracy" in printed
    figures = json.loads(out.read_text())
    assert figures["segments"] == 40
    assert f"{figures['accuracy']['mean']:.4f}" in printed
    low, high = figures["accuracy"]["interval"]
    assert low <= figures["accuracy"]["mean"] <= high


def test_a_run_is_trained_resumed_and_evaluated(capsys, tmp_path):
    run = str(tmp_path / "run")
    small = ["n_envs=8", "n_steps=32", "batch_size=64", "policy_kwargs.net_arch=[8]"]
    assert main(["train", "--out", run, "--steps", "256", "--set", *small]) == 0
    assert main(["train", "--resume", run, "--steps", "512"]) == 0
    assert "512 steps" in unwrapped(capsys)
    assert main(["evaluate", run, "--episodes", "3", "--scheme", "S10 S10"]) == 0
    assert main(["train", "--out", run]) == 2
    assert main(["train", "--resume", run, "--set", "n_envs=8"]) == 2
    assert main(["evaluate", run, "--radii", "1", "2"]) == 2


def test_reproduce_prints_results_and_writes_tables_and_figures(capsys, tmp_path):
    out = tmp_path / "results"
    assert main(["reproduce", "--runs", "4", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    for words in ("Table 4, decision", "Tsyganov 2019: Table, RMSE", "are recommended", "identification"):
        assert words in printed
    names = {path.name for path in out.iterdir()}
    assert {
        "golubkov2018.md",
        "golubkov2018_3.png",
        "tsyganov2019_1.png",
        "golubkov2020.png",
        "zimchuk.png",
        "reproduction.md",
    } <= names
    cells = json.loads((out / "tsyganov2019.json").read_text())["cells"]
    assert len(cells) == 15
    assert sum(cell["published"] is None for cell in cells) == 5
    assert "| Golubkov 2018 |" in (out / "reproduction.md").read_text()


def test_compare_prints_tables_and_writes_figures_and_data(capsys, tmp_path):
    out = tmp_path / "results"
    arguments = [
        "compare",
        "--episodes",
        "20",
        "--steps",
        "2048",
        "--agents",
        "ppo",
        "--scheme",
        "random 2x30-40",
        "--out",
        str(out),
    ]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    for name in (
        "ATE",
        "fixed time",
        "MSPRT",
        "ppo",
        "ppo compared with ATE",
        "Error rate",
        "published bank",
    ):
        assert name in printed
    data = json.loads((out / "compare.json").read_text())
    assert [entry["name"] for entry in data["deciders"]] == [
        "ATE (SPRT)", "fixed time", "MSPRT", "MSPRT, kept P", "calibrated anchor", "ppo",
    ]  # fmt: skip
    assert data["segments"] == 40
    assert (out / "compare.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in out.iterdir()} == {"agents", "compare.json", "compare.png", "episode.png"}


def test_compare_reports_the_spread_over_training_seeds(tmp_path, capsys):
    line = (
        "compare --selection-episodes 20 --deciders msprt --agents anchor --steps 12288 "
        f"--training-seeds 2 --episodes 20 --accuracy 0.9 --out {tmp_path}"
    )
    assert main(line.split()) == 0
    printed = capsys.readouterr().out
    for words in ("anchor seed 0", "anchor seed 1", "anchor over 2 training seeds", "90.0% accuracy"):
        assert words in printed


def test_compare_without_curves_evaluates_the_selected_thresholds_only(tmp_path, capsys):
    out = tmp_path / "quick"
    line = "compare --selection-episodes 20 --deciders ate msprt --agents --no-curves --episodes 20"
    assert main([*line.split(), "--out", str(out)]) == 0
    assert "ticks at" not in capsys.readouterr().out
    first, second = json.loads((out / "compare.json").read_text())["deciders"]
    assert len(first["curve"]["thresholds"]) > 10
    assert second["curve"]["thresholds"] == [second["threshold"]["chosen"]]
    assert "equal_time_error" not in second
    assert not (out / "episode.png").exists()


def test_an_anchor_agent_is_trained_resumed_and_evaluated_in_its_own_environment(tmp_path, capsys):
    folder = tmp_path / "run"
    line = f"train --recipe anchor --steps 4096 --measurement-variance 0.2 --out {folder} --set n_steps=16"
    assert main([*line.split(), "hidden=8", "worlds=[{n_envs: 16}]"]) == 0
    assert main(f"train --resume {folder} --steps 8192".split()) == 0
    assert "8,192 steps" in unwrapped(capsys)
    assert main(["evaluate", str(folder), "--episodes", "5"]) == 0
    assert "30 segments" in capsys.readouterr().out
    assert json.loads((folder / "policy.json").read_text())["options"] == {"measurement_variance": 0.2}


def test_evaluate_shows_degradation_in_shifted_environments(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(shifted_worlds, "SELECTION_EPISODES", 10)
    monkeypatch.setattr(shifted_worlds, "MOST_THRESHOLDS", 3)
    out = tmp_path / "shifts.json"
    line = f"evaluate fixed msprt --shifted --episodes 10 --scheme random\\ 2x20-30 --out {out}"
    import shlex

    assert main(shlex.split(line)) == 0
    printed = capsys.readouterr().out
    for words in ("nominal", "5 % outliers", "twice the radii", "half the length", "MSPRT"):
        assert words in printed
    data = json.loads(out.read_text())
    rows = data["results"]
    assert len(rows) >= 2 * 20
    assert all(row["low"] <= row["reward"] <= row["high"] for row in rows)
    assert all(row["nominal_low"] <= row["nominal_reward"] <= row["nominal_high"] for row in rows)
    by_world = {row["world"]: row for row in rows if row["decider"] == "fixed time"}
    assert by_world["half the length"]["ticks"] <= 15
    msprt = {row["world"]: row for row in rows if row["decider"] == "MSPRT"}
    for one in data["differences"]:
        difference = by_world[one["world"]]["reward"] - msprt[one["world"]]["reward"]
        assert one["difference"] == pytest.approx(difference)
        assert one["low"] <= one["difference"] <= one["high"]


def test_evaluate_draws_random_worlds(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(shifted_worlds, "SELECTION_EPISODES", 5)
    monkeypatch.setattr(shifted_worlds, "MOST_THRESHOLDS", 2)
    out = tmp_path / "drawn.json"
    assert main(["evaluate", "fixed", "--drawn", "3", "--episodes", "5", "--out", str(out)]) == 0
    assert "random world 3" in capsys.readouterr().out
    data = json.loads(out.read_text())
    assert [row["world"] for row in data["results"]][:2] == ["nominal", "random world 1"]
    for world in data["worlds"].values():
        WorldOptions.of(**world)
