"""What limits a decision: steps of information on the same episodes, their tables and figures."""

import itertools
import json

import numpy as np
import pytest
from given_scores import announced_scores

from agents.cli import main
from agents.evaluation.registry import find_family
from agents.evaluation.task import sweep
from agents.evaluation.unknown import UnknownTask
from agents.figures.decider_colours import decider_style
from agents.interface.parallel import Workers
from agents.studies import limits
from agents.studies.limits import (
    BANK,
    BANKS,
    BEAM,
    GEOMETRIC,
    IMM,
    LAGS,
    LATER,
    LAWS,
    NAMES,
    NOISE_LEVELS,
    QUICKEST,
    STEPS,
    THREE,
    THRESHOLD,
    TIMES,
    calls,
    smoothed_scores,
    unknown_steps,
)
from baselines import ThresholdDecider, measure_statements, record_statements
from baselines.rules import seeds
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import mean

UNKNOWN_STEPS = (IMM, THRESHOLD, GEOMETRIC, BEAM, *LATER.values())  # in the order of their information
SHORT = {"durations": "uniform 10-20", "ticks": 60}
RULES = ("ATE (SPRT)", "MSPRT", "Bayes risk")


def exactly(value):
    return Estimate(value, value, value)


@pytest.fixture(scope="module")
def announced():
    """MSPRT and Bayes risk coincide; ATE never reaches 95 % on the first bank."""
    rules, steps = [], []
    for bank, noise, rule in itertools.product(BANKS, NOISE_LEVELS, RULES):
        time = 20.0 + 10.0 * np.log10(noise / 0.01) - (0.0 if rule == RULES[0] else 3.0)
        missed = rule == RULES[0] and bank == BANKS[0]
        curve = announced_scores(rule, [0.5, 0.9 if missed else 1.0], [time, time])
        figures = {name: curve.estimate(statistic) for name, statistic in TIMES.items()}
        figures |= {"reward": curve.at(0).estimate(mean("reward")), "threshold": 1.0}
        rules.append({"env_id": THREE, "noise": noise, "bank": bank, "rule": rule} | figures)
    for env, noise, (k, step) in itertools.product((THREE, BANK), NOISE_LEVELS, enumerate(STEPS)):
        steps.append({"env_id": env, "noise": noise, "step": step, "reward": exactly(0.5 + 0.02 * k), "gain": None})
    calibration = [{"bank": "oracle", "noise": 0.1, "ticks": 5, "right": 0.5, "stated": 0.52, "worst": -0.031}]
    golubkov = [{"bank": "anchor_aware", "noise": 1.0, "accuracy": exactly(0.98), "ticks": 45.5}]
    return {"steps": steps, "rules": rules, "calibration": calibration, "golubkov2018": golubkov}


@pytest.fixture(scope="module")
def unknown():
    found = []
    for law, noise, (k, step) in itertools.product(LAWS, NOISE_LEVELS, enumerate(UNKNOWN_STEPS)):
        row = {"law": law, "noise": noise, "step": step, "reward": exactly(0.8 - 0.05 * np.log10(noise) + 0.02 * k)}
        row |= {"gain": exactly(0.02) if k else None, "delay": exactly(10.0), "wrong_changes": exactly(2.0)}
        found.append(row | {"most_probable_right": exactly(0.9)})
    return {"steps": found}


def rows_of(text):
    return [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| step |")]


def test_tables_for_announced_switches(announced):
    text = limits.markdown(announced)
    assert "| R = 0.01 | R = 0.1 | R = 1 |" in text
    rows = rows_of(text)
    assert sum(row.startswith(tuple(f"| {step} |" for step in STEPS)) for row in rows) == 2 * len(STEPS)
    banks = [row for row in rows if any(f"| {rule} |" in row for rule in RULES)]
    assert len(banks) == len(BANKS) * len(RULES)
    assert banks[0].startswith("| published | ATE (SPRT) | not reached / not reached; -0.400 [-0.400, -0.400]")
    assert banks[1].startswith("| published | MSPRT | 17.0 [17.0, 17.0] / 17.0 [17.0, 17.0]; -0.340")
    assert "| oracle | 0.1 | 50.0 / 52.0 (-3.1) |" in text
    assert "| anchor-aware | 1 | 98.0 [98.0, 98.0] | 45.5 |" in text


def test_every_rule_is_labelled_in_its_colour_and_missing_times_are_marked(announced):
    figure = limits.figure(announced)
    assert len(figure.axes) == len(BANKS)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(RULES)
    colours = {rule: decider_style(rule).colour for rule in RULES}
    for axes, bank in zip(figure.axes, BANKS, strict=True):
        highest = {line.get_color(): max(line.get_ydata()) for line in axes.lines[: len(RULES)]}
        assert list(highest) == [*colours.values()]
        missing = {colour for colour, time in highest.items() if time > 1.03 * axes.get_ylim()[1] / 1.15}
        assert missing == ({colours["ATE (SPRT)"]} if bank == BANKS[0] else set())
    assert "not reached" in [label.get_text() for label in figure.axes[0].get_yticklabels()]


def test_tables_and_figure_for_unknown_switches(unknown):
    text = limits.markdown(unknown)
    assert text.count("###") == len(LAWS)
    rows = rows_of(text)
    assert len(rows) == len(LAWS) * (3 * len(UNKNOWN_STEPS) - 1)
    assert all(line.count("|") == 2 + len(NOISE_LEVELS) for line in rows)
    assert rows[1].startswith("| IMM, tuned threshold | 0.920 (+0.020 [+0.020, +0.020]) |")
    figure = limits.figure(unknown)
    assert len(figure.axes) == len(LAWS) * len(NOISE_LEVELS)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == set(NAMES.values())
    for axes in figure.axes:
        [curve] = [line for line in axes.lines if line.get_marker() not in ("None", "", None, "none")]
        np.testing.assert_array_equal(curve.get_xdata(), [0, *LAGS])


def test_each_step_has_a_paired_gain(monkeypatch):
    few = list(STEPS)[:3]  # the others need further compiled banks
    monkeypatch.setattr(limits, "NOISE_LEVELS", (0.1,))
    monkeypatch.setattr(limits, "STEPS", {step: STEPS[step] for step in few})
    found = [one for _, rows in Workers().results(calls("", 10, 0)["steps"]) for one in rows]
    assert [one["step"] for one in found] == 2 * few
    assert [one["step"] for one in found if one["gain"] is None] == 2 * few[:1]
    for before, one in itertools.pairwise(found[: len(few)]):
        gain = one["gain"]
        assert gain.value == pytest.approx(one["reward"].value - before["reward"].value)
        assert gain.low <= gain.value <= gain.high


def test_the_gap_rule_reaches_a_high_type_accuracy_on_the_scheme_of_2018(monkeypatch):
    monkeypatch.setattr(limits, "BANKS", BANKS[:1] * 2)
    found = [one for _, rows in Workers().results(calls("", 20, 0)["golubkov2018"]) for one in rows]
    assert [one["noise"] for one in found] == list(NOISE_LEVELS)
    ticks = [one["ticks"] for one in found]
    assert min(one["accuracy"].value for one in found) > 0.9
    assert ticks == sorted(ticks)


def test_without_later_ticks_the_smoothed_scores_are_those_of_the_beam(monkeypatch):
    monkeypatch.setattr(limits, "SMOOTHED_TRACKS", 7)
    task = UnknownTask(QUICKEST, SHORT)
    smoothed = smoothed_scores(task, 10, 3, (0, 15))
    beam = sweep(task, find_family("beam", task.options), 10, 3)
    np.testing.assert_array_equal(smoothed[0].values, beam.values)
    assert smoothed[15].name == "beam, 15 ticks later"
    later, now = (scores.curve(mean("right"))[0] for scores in (smoothed[15], beam))
    assert later > now + 0.02


def test_every_step_is_reported_with_a_threshold_from_other_tracks(monkeypatch):
    seen, original = [], limits.sweep

    def counted(task, family, tracks, seed):
        seen.append((tracks, seed))
        return original(task, family, tracks, seed)

    monkeypatch.setattr(limits, "sweep", counted)
    found = unknown_steps("uniform 50-100", 0.1, 20, 7)
    assert [one["step"] for one in found] == list(UNKNOWN_STEPS)
    assert set(seen) == {(50, seeds.SELECTION), (20, 7)}
    assert found[0]["threshold"] == 0.0
    tuned = found[UNKNOWN_STEPS.index(THRESHOLD)]
    world = {"durations": "uniform 50-100", "measurement_variance": 0.1}
    metrics = measure_statements(record_statements(ThresholdDecider(tuned["threshold"]), 20, 7, **world))
    assert tuned["reward"].value == pytest.approx(metrics.reward.mean())
    right = {one["step"]: one["most_probable_right"].value for one in found}
    assert right[BEAM] < right[LATER[LAGS[0]]] < right[LATER[LAGS[-1]]]
    delays = [one["delay"].value for one in found]
    assert delays[-1] < delays[UNKNOWN_STEPS.index(BEAM)]


@pytest.mark.parametrize("env", ["", "HybridTrackQuickest-v0"])
def test_the_command_writes_its_files(env, announced, unknown, tmp_path, capsys, monkeypatch):
    given = {part: {part: list} for part in (unknown if env else announced)}
    results = unknown if env else announced

    def found(self, named, on_progress):
        return [(part, results[part]) for part in named]

    monkeypatch.setattr(limits, "calls", lambda *_: given)
    monkeypatch.setattr(Workers, "results", found)
    flags = ["--env", env] if env else []
    assert main(["limits", *flags, "--episodes", "10", "--out", str(tmp_path)]) == 0
    assert ("later ticks" if env else "anchor-aware") in capsys.readouterr().out
    data = json.loads((tmp_path / "limits.json").read_text())
    assert data == json.loads(json.dumps(results, default=Estimate.as_json))
    assert len(data["steps"]) == len(results["steps"])
    assert (tmp_path / "limits.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "limits.md").read_text() == limits.markdown(results)
