"""The sequence agent: symmetries of the network, reproducible training, files, and decisions."""

import json

import numpy as np
import pytest
import torch

from agents.evaluation.deciders import load_decider
from agents.evaluation.evaluate import evaluate
from agents.learned.policy_file import load_policy
from agents.learned.sequence import (
    SequenceDecider,
    SequenceNet,
    error_probability_and_best,
    load_sequence,
    save_sequence,
)
from agents.training.recipe import load_recipe, recipe_of
from agents.training.runs import make_run, resume_run
from baselines import FixedTimeDecider, SPRTDecider
from hybrid_env import HybridTrackVectorEnv, Layout, WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
SMALL = load_recipe("sequence", ENV, ("n_steps=16", "hidden=12", "worlds=[{n_envs: 32}]"))


def trained(recipe, steps, seed=0, **options):
    run = make_run(ENV, options, recipe, seed, steps=steps)
    run.train()
    return run.net


def random_net(seed=0, hidden=12):
    torch.manual_seed(seed)
    net = SequenceNet(hidden)
    torch.nn.init.normal_(net.score.weight)
    return net


def mirrored(rows):
    """Observation rows of the mirrored trajectory, with left and right turns exchanged."""
    layout = Layout.of_rows(rows)
    M, n = layout.hypotheses, layout.hypotheses // 2
    order = np.array([0, *range(n + 1, M), *range(1, n + 1)])
    out = rows.copy()
    for name in (
        "log_ratio",
        "innovation_along",
        "innovation_across",
        "log_variance",
        "previous",
        "curvature",
    ):
        out[:, layout.slices[name]] = rows[:, layout.slices[name]][:, order]
    for name in ("innovation_across", "curvature", "displacement_across"):
        out[:, layout.slices[name]] *= -1
    return out, order


def test_left_and_right_turns_have_mirrored_features():
    # the straight hypothesis has no side, so only its lateral features may differ
    env = HybridTrackVectorEnv(16, radii=(3.0, 5.0))
    rows, _ = env.reset(seed=1)
    rows[:, env.world.layout.slices["innovation_across"]][:, 0] = 0.0
    net = random_net()
    reflected, order = mirrored(rows)
    with torch.no_grad():
        first, second = (net.features(torch.from_numpy(one))[..., :12] for one in (rows, reflected))
    np.testing.assert_allclose(first[:, order][:, 1:], second[:, 1:], atol=1e-6)


@pytest.mark.parametrize("radii", [(5.0,), (2.0, 5.0, 9.0)])
def test_one_network_applies_to_any_bank_and_does_not_depend_on_the_order_of_radii(radii):
    net = random_net()
    posteriors = []
    for order in (radii, radii[::-1]):
        env = HybridTrackVectorEnv(8, radii=order, scheme="S60 L60r5 S60")
        rows, _ = env.reset(seed=3)
        hidden_state = torch.zeros(8, 2 * len(radii) + 1, 12)
        for _ in range(12):
            with torch.no_grad():
                hidden_state = net.next_hidden_state(net.features(torch.from_numpy(rows)), hidden_state)
                posterior = net.log_posterior(torch.from_numpy(rows), hidden_state)
            rows = env.step(np.zeros(8, np.int64))[0]
        posteriors.append(posterior.numpy())
    n = len(radii)
    reversed_order = [0, *range(n, 0, -1), *range(2 * n, n, -1)]
    np.testing.assert_allclose(posteriors[0], posteriors[1][:, reversed_order], atol=1e-4)


def test_the_hidden_state_is_reset_at_every_segment():
    decider = SequenceDecider(random_net(), alpha=1e-6)
    env = HybridTrackVectorEnv(4, scheme="random 3x5")
    rows, _ = env.reset(seed=2)
    state = None
    for _ in range(5):
        _, state = decider.predict(rows, state)
        rows = env.step(np.zeros(4, np.int64))[0]
    first = decider.predict(rows, state)[1]
    np.testing.assert_array_equal(first, decider.predict(rows, None)[1])


def test_the_same_seed_gives_the_same_weights():
    nets = [trained(SMALL, 2000, seed=4) for _ in range(2)]
    for one, other in zip(*(net.state_dict().values() for net in nets), strict=True):
        assert torch.equal(one, other)


def test_short_training_beats_a_fixed_decision_time():
    net = trained(load_recipe("sequence", ENV, ("hidden=16",)), 150_000)
    learned = evaluate(SequenceDecider(net, 0.1), episodes=200, seed=7)
    fixed = evaluate(FixedTimeDecider(round(learned.ticks.mean())), episodes=200, seed=7)
    assert learned.correct.mean() > fixed.correct.mean()


def test_weights_and_card_are_restored_and_a_folder_is_a_decider(tmp_path):
    net = random_net()
    save_sequence(tmp_path, net, {"environment": ENV, "options": {}, "recipe": SMALL.as_json()})
    weights, card = load_policy(tmp_path)
    again = load_sequence(tmp_path, weights, card)
    for one, other in zip(net.state_dict().values(), again.state_dict().values(), strict=True):
        assert torch.equal(one, other)
    decider = load_decider(f"{tmp_path}:0.05", WorldOptions())
    assert decider.alpha == 0.05
    assert load_decider(str(tmp_path), WorldOptions(correctness="type")).radius_weight < 1.0
    card["observation_scales"]["ticks"] = 5.0
    (tmp_path / "policy.json").write_text(json.dumps(card))
    with pytest.raises(ValueError, match="other scales"):
        load_policy(tmp_path)
    card["recipe"]["entry"]["hidden"] = 7
    with pytest.raises(ValueError, match="run="):
        load_sequence(tmp_path, weights, card)
    (tmp_path / "policy.safetensors").write_bytes(b"\x00")
    with pytest.raises(ValueError, match="run="):
        load_policy(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_steps": 0}, "n_steps=0"),
        ({"random_declarations": 1.0}, "random_declarations=1.0"),
        ({"worlds": [{"n_envs": 0}]}, "n_envs=0"),
        ({"worlds": [{"tracks": 3}]}, "worlds="),
        ({"worlds": [{"n_envs": 3, "options": 3}]}, "options=3"),
        ({"worlds": [{"n_envs": 3, "options": {"bad": 1}}]}, "option='bad'"),
        ({"worlds": [{"n_envs": 3, "env": 3}]}, "env=3"),
        ({"hidden": 1.5}, "hidden=1.5"),
        ({"learning_rate": -1.0}, "learning_rate=-1.0"),
        ({"smallest_alpha": 0.5}, "smallest_alpha=0.5"),
        ({"last_tick": 0}, "last_tick=0"),
    ],
)
def test_invalid_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        recipe_of("mine", SMALL.as_json()["entry"] | arguments)


def test_training_uses_several_environments_and_banks_at_once():
    worlds = [
        {"n_envs": 8, "options": {"measurement_variance": 0.01}},
        {"n_envs": 8, "options": {"measurement_variance": 1.0}},
        {"n_envs": 4, "env": "hybrid_env:HybridTrackBank-v0"},
    ]
    recipe = recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds})
    net = trained(recipe, 1000)
    assert evaluate(SequenceDecider(net, 0.5), episodes=3, radii=(2.0, 5.0)).ticks.shape == (3, 6)
    with pytest.raises(ValueError, match="alpha="):
        SequenceDecider(net, 0.0)
    with pytest.raises(ValueError, match="radius_weight="):
        SequenceDecider(net, 0.1, radius_weight=2.0)


def test_an_interrupted_run_resumes_from_its_last_checkpoint(tmp_path):
    folder = tmp_path / "run"
    run = make_run(ENV, {}, SMALL, 0, folder, 4096)

    def interrupt(progress):
        if progress.steps == 2048:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt, save_every=1e-9)
    resumed = resume_run(folder)
    assert resumed.num_timesteps == 1536  # the incomplete rollout is lost
    for one, other in zip(
        load_sequence(folder, *load_policy(folder)).state_dict().values(),
        resumed.net.state_dict().values(),
        strict=True,
    ):
        assert torch.equal(one, other)
    resumed.train()
    assert resumed.num_timesteps == 4096
    assert resume_run(folder, steps=5000).steps == 5000


def test_the_error_probability_is_the_posterior_of_wrong_declarations():
    posterior = np.array([[0.05, 0.30, 0.31, 0.04, 0.30], [0.4, 0.2, 0.15, 0.15, 0.1]])
    error_probability, best = error_probability_and_best(posterior, 0.0)
    np.testing.assert_allclose(error_probability, [0.39, 0.6])
    np.testing.assert_array_equal(best, [2, 0])
    np.testing.assert_allclose(error_probability_and_best(posterior, 1.0)[0], [0.69, 0.6])
    np.testing.assert_allclose(error_probability_and_best(posterior, 0.5)[0], [0.54, 0.6])
    # the most likely hypothesis need not be of the most likely type
    split = np.array([[0.4, 0.35, 0.25, 0.0, 0.0]])
    assert [error_probability_and_best(split, weight)[1][0] for weight in (0.0, 1.0)] == [1, 0]
    small = np.array([[1.0, 1e-12, 1e-13]])
    np.testing.assert_allclose(error_probability_and_best(small, 1.0)[0], 1.1e-12)


def test_environment_options_of_the_recipe_override_those_of_the_run():
    worlds = [{"n_envs": 8, "options": {"measurement_variance": 0.5}}, {"n_envs": 8}]
    recipe = recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds})
    run = make_run(ENV, {"measurement_variance": 0.2}, recipe, steps=1)
    envs = [env for stream in run._streams for env in stream.envs]
    assert [env.options.measurement_variance for env in envs] == [0.5, 0.2]
    worlds[0]["options"]["actions"] = "best"
    with pytest.raises(ValueError, match="actions='best'"):
        make_run(ENV, {}, recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds}), steps=1)


@pytest.mark.parametrize("options", [{}, {"measurement_variance": 1.0}])
def test_the_shipped_agent_beats_the_sprt_at_any_threshold(options):
    decider = load_decider("shipped", WorldOptions(**options))
    reward = evaluate(decider, episodes=100, seed=50, **options).reward.mean(1)
    for alpha in (0.1, 1e-2, 1e-3, 1e-6):
        gain = reward - evaluate(SPRTDecider(alpha), episodes=100, seed=50, **options).reward.mean(1)
        assert gain.mean() > 4 * gain.std() / 10


def test_the_shipped_agent_beats_the_sprt_on_a_bank_of_101_hypotheses_not_used_in_training():
    world = {
        "radii": tuple(np.arange(0.5, 10.4, 0.2).round(1).tolist()),
        "correctness": "type",
        "delay_cost": 0.01,
    }
    options = WorldOptions(**world)
    assert options.hypotheses == 101
    reward = evaluate(load_decider("shipped", options), episodes=30, seed=50, **world).reward.mean(1)
    for alpha in (1e-3, 1e-6):
        gain = reward - evaluate(SPRTDecider(alpha), episodes=30, seed=50, **world).reward.mean(1)
        assert gain.mean() > 3 * gain.std(ddof=1) / np.sqrt(30)
