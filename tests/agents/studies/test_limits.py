"""What limits a decision: steps of information on the same episodes, their tables and figures."""

import itertools
import json

import numpy as np
import pytest
from given_scores import announced_scores

from agents.cli import main
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
    NOISE_LEVELS,
    STEPS,
    THREE,
    THRESHOLD,
    TIMES,
    unknown_steps,
)
from baselines import ThresholdDecider, measure_statements, record_statements
from baselines.rules import seeds
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import mean

# In the order of their information.
UNKNOWN_STEPS = (IMM, THRESHOLD, GEOMETRIC, BEAM, *LATER.values())
RULES = ("ATE (SPRT)", "MSPRT", "Bayes risk")


def exactly(value):
    return Estimate(value, value, value)


@pytest.fixture(scope="module")
def announced():
    """MSPRT and Bayes risk coincide; ATE never reaches 95 % on the first bank."""
    rules = []
    steps = []
    for bank, noise, rule in itertools.product(BANKS, NOISE_LEVELS, RULES):
        time = 20.0 + 10.0 * np.log10(noise / 0.01) - (0.0 if rule == RULES[0] else 3.0)
        missed = rule == RULES[0] and bank == BANKS[0]
        curve = announced_scores(rule, [0.5, 0.9 if missed else 1.0], [time, time])
        figures = {name: curve.estimate(statistic) for name, statistic in TIMES.items()}
        figures |= {"reward": curve.at(0).estimate(mean("reward")), "threshold": 1.0}
        rules.append(
            {
                "env_id": THREE,
                "noise": noise,
                "bank": bank,
                "rule": rule,
            }
            | figures
        )
    for env, noise, (k, step) in itertools.product((THREE, BANK), NOISE_LEVELS, enumerate(STEPS)):
        steps.append(
            {
                "env_id": env,
                "noise": noise,
                "step": step,
                "reward": exactly(0.5 + 0.02 * k),
                "gain": None,
            }
        )
    calibration = [
        {
            "bank": "oracle",
            "noise": 0.1,
            "ticks": 5,
            "right": 0.5,
            "stated": 0.52,
            "worst": -0.031,
        }
    ]
    golubkov = [
        {
            "bank": "anchor_aware",
            "noise": 1.0,
            "accuracy": exactly(0.98),
            "ticks": 45.5,
        }
    ]
    return {
        "steps": steps,
        "rules": rules,
        "calibration": calibration,
        "golubkov2018": golubkov,
    }


@pytest.fixture(scope="module")
def unknown():
    found = []
    for law, noise, (k, step) in itertools.product(LAWS, NOISE_LEVELS, enumerate(UNKNOWN_STEPS)):
        row = {
            "law": law,
            "noise": noise,
            "step": step,
            "reward": exactly(0.8 - 0.05 * np.log10(noise) + 0.02 * k),
        }
        row |= {
            "gain": exactly(0.02) if k else None,
            "delay": exactly(10.0),
            "wrong_changes": exactly(2.0),
        }
        found.append(row | {"most_probable_right": exactly(0.9)})
    return {"steps": found}


def test_every_step_is_reported_with_a_threshold_from_other_tracks(monkeypatch):
    seen = []
    original = limits.sweep

    def counted(task, family, tracks, seed):
        seen.append((tracks, seed))
        return original(task, family, tracks, seed)

    monkeypatch.setattr(limits, "sweep", counted)
    found = unknown_steps("uniform 50-100", 0.1, 20, 7)

    assert [one["step"] for one in found] == list(UNKNOWN_STEPS)
    assert set(seen) == {
        (50, seeds.SELECTION),
        (20, 7),
    }
    assert found[0]["threshold"] == 0.0
    tuned = found[UNKNOWN_STEPS.index(THRESHOLD)]
    world = {"durations": "uniform 50-100", "measurement_variance": 0.1}
    metrics = measure_statements(
        record_statements(ThresholdDecider(tuned["threshold"]), 20, 7, **world)
    )
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
