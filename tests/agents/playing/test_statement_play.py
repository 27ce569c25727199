"""The command `hybridtrack play` with unknown switch moments."""

import itertools

import gymnasium as gym
import numpy as np
import pytest
import torch
from PIL import Image
from rich.console import Console

import hybrid_env  # noqa: F401
from agents.evaluation.statement_deciders import RULES
from agents.learned.policy import make_policy
from agents.learned.policy import StatementPolicyDecider
from agents.playing.command import Play
from agents.playing.episodes import StatementEpisodes
from agents.playing.statement_evidence import statement_evidence
from baselines import BeamDecider, ThresholdDecider
from baselines.recordings.reading.read import read_recordings
from hybrid_env import QuickestLayout
from hybrid_env.checks import ArgumentError
from hybrid_env.rendering.figure import FRAME_SIZE
from hybrid_env.rendering.quickest_figure import QuickestRenderer

ENV = "hybrid_env:HybridTrackQuickest-v0"
SHORT = {"ticks": 40, "durations": "uniform 10-15"}


def play(**arguments):
    Play(**{"env": ENV, "seed": 3} | SHORT | arguments).run()


def environment(**options):
    return gym.make(ENV, render_mode="rgb_array", **SHORT, **options).unwrapped


def statements(decider, seed):
    """Statements, probabilities of the bank and measurements of an episode."""
    env = environment()
    row, info = env.reset(seed=seed)
    start, state, terminated, found = np.ones(1, np.bool_), None, False, []
    while not terminated:
        rows = row[None] if not hasattr(decider, "observe") else decider.observe(env.world)
        actions, state = decider.predict(rows, state, start)
        posterior = state.log_probability[0] if isinstance(decider, BeamDecider) else info["log_probability"]
        env.history.set_evidence(np.exp(posterior))
        found.append((int(actions[0]), np.exp(posterior), info["measurement"], info["true_mode"]))
        row, _, terminated, _, info = env.step(actions[0])
        start[:] = False
    return env, [np.array(one) for one in zip(*found, strict=True)]


def actor():
    torch.manual_seed(0)
    space = environment().observation_space, environment().action_space
    return StatementPolicyDecider(
        make_policy(*space, {"net_arch": [8], "ortho_init": False}, layout=QuickestLayout)
    )


@pytest.mark.parametrize("name", ["threshold:0.7", "beam"])
def test_a_picture_shows_statements_and_what_the_decider_compares(tmp_path, name):
    play(out=tmp_path / "episode.png", decider=name)
    env = environment()
    decider = ThresholdDecider(0.7) if name.startswith("threshold") else BeamDecider(env.options)
    env, (_, probabilities, _, _) = statements(decider, 3)
    np.testing.assert_allclose(env.history.probabilities, probabilities)
    frame = QuickestRenderer(env.options, False, statement_evidence(decider).panel).draw(env.history)
    with Image.open(tmp_path / "episode.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), frame)


def test_the_evidence_of_a_policy_is_its_probabilities():
    decider = actor()
    rows, _ = environment().reset(seed=0)
    found = statement_evidence(decider).compute(rows[None], None, np.ones(1, np.bool_))
    logits = decider.logits(rows[None])[0]
    np.testing.assert_allclose(found, np.exp(logits) / np.exp(logits).sum())
    assert statement_evidence(decider).panel.label == "probability (policy)"


@pytest.mark.parametrize("name", [name for name in RULES if not name.startswith("beam")])
def test_other_rules_have_the_probabilities_of_the_bank(name):
    env, other = environment(), environment()
    episodes = StatementEpisodes(env, name)
    history = list(itertools.islice(episodes.play(0, lambda: None), 20))[-1]
    other.reset(seed=0)
    for _ in range(19):
        other.step(0)
    np.testing.assert_allclose(history.probabilities, other.history.probabilities, atol=1e-5)  # float32 rows
    assert len(episodes.evidence.panel.thresholds) == (name == "threshold")


def test_the_evidence_of_a_beam_does_not_change_its_state():
    env = environment()
    env.reset(seed=0)
    decider = BeamDecider(env.options)
    _, state = decider.predict(decider.observe(env.world))
    env.step(0)
    before = state.log_probability.copy()
    rows, start = decider.observe(env.world), np.zeros(1, np.bool_)
    evidence = statement_evidence(decider)
    found = evidence.compute(rows, state, start)
    np.testing.assert_array_equal(state.log_probability, before)
    np.testing.assert_array_equal(found, np.exp(decider.predict(rows, state, start)[1].log_probability))
    assert evidence.panel.thresholds[0].levels == [0.6]


def test_a_gif_has_one_frame_for_each_statement_and_the_end(tmp_path):
    play(out=tmp_path / "two.gif", episodes=2, ticks=12)
    with Image.open(tmp_path / "two.gif") as animation:
        assert animation.n_frames == 2 * (12 + 1)
        assert animation.size == FRAME_SIZE


def test_the_table_has_a_row_for_each_segment():
    env = environment()
    episodes = StatementEpisodes(env, "threshold")
    for _ in episodes.play(3, lambda: None):
        pass
    _, (stated, _, _, true) = statements(ThresholdDecider(), 3)
    bounds = [0, *(np.flatnonzero(np.diff(true)) + 1), len(true)]
    console = Console(width=200, record=True)
    with console.capture() as captured:
        console.print(episodes.table("An episode"))
    lines = [line.split("│")[1:-1] for line in captured.get().splitlines() if line.startswith("│")]
    assert [int(line[2]) for line in lines] == np.diff(bounds).tolist()
    right = (stated == true).mean()
    assert f"right {right:.1%}, reward " in captured.get()
    for line, first, end in zip(lines, bounds[:-1], bounds[1:], strict=True):
        inside = stated[first:end] == true[first:end]
        assert line[3].strip() == (str(inside.argmax()) if inside.any() else "never")
        assert line[4].strip() == f"{inside.mean():.0%}"


def test_the_recording_contains_every_measurement(tmp_path):
    play(record=tmp_path / "episode.csv", out=tmp_path / "episode.png", tau=0.2)
    [recording] = read_recordings(tmp_path / "episode.csv").recordings
    env = environment(tau=0.2)
    measured = [env.reset(seed=3)[1]["measurement"]]
    measured += [env.step(0)[4]["measurement"] for _ in range(39)]
    np.testing.assert_array_equal(recording.positions, measured)
    assert recording.tick == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"decider": "ate"}, r"^decider='ate' is not allowed: expected 'threshold', "),
        ({"decider": "threshold:2"}, r"^threshold=2.0 is not allowed"),
        ({"scheme": "S5"}, r"^scheme='S5' is not allowed"),
        ({"env": "hybrid_env:HybridTrack-v0"}, r"^(ticks|durations)=.* is not allowed"),
    ],
)
def test_the_error_for_an_invalid_argument_is_one_line(tmp_path, arguments, message):
    with pytest.raises(ArgumentError, match=message) as error:
        play(out=tmp_path / "episode.png", **arguments)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []
