"""What limits a statement: steps of information on the same tracks, their tables and their figure."""

import itertools
import json

import numpy as np
import pytest
from agents.evaluation.operating_curve import Estimate
from agents.evaluation.statement_curve import RIGHT, mean_of, sweep_statements
from agents.evaluation.statement_deciders import beam_family
from agents.limits import statement_study
from agents.limits.figures import NAMES, statement_limits
from agents.limits.statement_report import statement_steps_markdown
from agents.limits.statement_study import (
    BEAM,
    LAGS,
    LATER,
    LAWS,
    STEPS,
    THRESHOLD,
    StatementStep,
    smoothed_curves,
    statement_calls,
)
from agents.limits.study import NOISE_LEVELS
from baselines.rules.metrics import measure_statements

from agents.cli import main
from agents.interface.parallel import Workers
from baselines.rules import seeds
from baselines.rules.rollout import record_statements
from baselines.rules.threshold import ThresholdDecider
from hybrid_env.quickest_options import QuickestOptions

SHORT = QuickestOptions(durations="uniform 10-20", ticks=60)


@pytest.fixture(scope="module")
def results():
    found = []
    for law, noise, (k, step) in itertools.product(LAWS, NOISE_LEVELS, enumerate(STEPS)):
        value = 0.9 - 0.1 * np.log10(noise) * 0.5 - 0.02 * (len(STEPS) - k)
        one, gain = Estimate(value, value - 0.01, value + 0.01), Estimate(0.02, 0.01, 0.03)
        found.append(StatementStep(law, noise, step, 0.6, one, gain if k else None, one, one, one))
    return found


def test_without_later_ticks_the_smoothed_curve_is_that_of_the_beam(monkeypatch):
    monkeypatch.setattr(statement_study, "SMOOTHED_TRACKS", 7)
    family = beam_family(SHORT)
    smoothed = smoothed_curves(family, SHORT, 10, 3, (0, 15))
    beam = sweep_statements(family, SHORT, 10, 3)
    np.testing.assert_array_equal(smoothed[0].tracks, beam.tracks)
    assert smoothed[15].family.name == "beam, 15 ticks later"
    later, now = (curve.values(mean_of(RIGHT))[0] for curve in (smoothed[15], beam))
    assert later > now + 0.02


def test_every_step_is_reported_with_a_threshold_from_other_tracks(monkeypatch):
    monkeypatch.setattr(statement_study, "NOISE_LEVELS", (0.1,))
    monkeypatch.setattr(statement_study, "LAWS", ("uniform 50-100",))
    seen = []
    sweep = statement_study.sweep_statements

    def counted(family, options, tracks, seed):
        seen.append((tracks, seed))
        return sweep(family, options, tracks, seed)

    monkeypatch.setattr(statement_study, "sweep_statements", counted)
    [(_, found)] = Workers().results(statement_calls(20, 7))
    assert [one.step for one in found] == list(STEPS)
    assert set(seen) == {(50, seeds.SELECTION), (20, 7)}
    for before, one in itertools.pairwise(found):
        assert one.gain.value == pytest.approx(one.reward.value - before.reward.value)
    assert found[0].threshold == 0.0
    world = {"durations": "uniform 50-100"}
    tuned = found[STEPS.index(THRESHOLD)]
    metrics = measure_statements(record_statements(ThresholdDecider(tuned.threshold), 20, 7, **world))
    assert tuned.reward.value == pytest.approx(metrics.reward.mean())
    best = {one.step: one.most_probable_right.value for one in found}
    assert best[BEAM] < best[LATER[LAGS[0]]] < best[LATER[LAGS[-1]]]
    assert found[-1].delay.value < found[STEPS.index(BEAM)].delay.value


def test_tables_have_a_row_for_each_step_and_a_column_for_each_noise(results):
    text = statement_steps_markdown(results)
    assert text.count("###") == len(LAWS)
    rows = [line for line in text.splitlines() if line.startswith("| ") and "| step |" not in line]
    assert len(rows) == len(LAWS) * (3 * len(STEPS) - 1)
    assert all(line.count("|") == 2 + len(NOISE_LEVELS) for line in rows)
    assert rows[1].startswith("| IMM, tuned threshold | 0.860 (+0.020 [+0.010, +0.030]) |")


def test_the_figure_has_a_panel_for_each_law_and_noise_with_every_rule_labelled(results):
    figure = statement_limits(results)
    assert len(figure.axes) == len(LAWS) * len(NOISE_LEVELS)
    for axes in figure.axes:
        assert {text.get_text() for text in axes.texts} == set(NAMES.values())
        [curve] = [line for line in axes.lines if line.get_marker() not in ("None", "", None, "none")]
        np.testing.assert_array_equal(curve.get_xdata(), [0, *LAGS])


def test_the_command_writes_its_files(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(statement_study, "QuickestOptions", lambda **_: SHORT)
    line = ["limits", "--env", "HybridTrackQuickest-v0", "--episodes", "10", "--out", str(tmp_path)]
    assert main(line) == 0
    assert "later ticks" in capsys.readouterr().out
    steps = json.loads((tmp_path / "limits.json").read_text())["steps"]
    assert len(steps) == len(LAWS) * len(NOISE_LEVELS) * len(STEPS)
    assert (tmp_path / "limits.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "limits.md").read_text().startswith("### HybridTrackQuickest-v0")


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--env", "HybridTrack-v0"], "env='HybridTrack-v0'"),
        (["--env", "HybridTrackQuickest-v0", "--seed", "1000000000"], "seed=1000000000"),
        (["--env", "HybridTrackQuickest-v0", "--episodes", "1"], "episodes=1"),
    ],
)
def test_invalid_arguments_are_refused_in_one_line(flags, message, capsys, tmp_path):
    assert main(["limits", "--out", str(tmp_path / "out"), *flags]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
