"""KalmanNet on segments: paths, symmetry, and one row after the other."""

import numpy as np
import pytest
import torch
from scipy.special import log_softmax

from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from hybrid_env import Layout
from studies.league.families import recipe_file
from studies.league.kalman import KalmanDecider, filter_inputs, segment_logs, turning
from studies.league.reward import Explorer

ENV = "hybrid_env:HybridTrackPublished-v0"


def random_run(options):
    run = make_run(
        ENV,
        options,
        load_recipe(
            recipe_file("kalman"),
            ENV,
            ("n_envs=6", "hidden=8"),
        ),
    )
    for layers in (run.net.gain, run.net.covariance):
        torch.nn.init.normal_(layers[2].weight, std=0.05)
    return run, Explorer(
        KalmanDecider(run.net, run.world),
        np.random.default_rng(1),
    ).segments(
        run.env,
        5,
    )


def test_the_motion_of_a_deviation_is_the_difference_of_two_turning_paths():
    turn = 0.3
    velocity = np.array([2.0, 0.1])
    angles = turn * np.linspace(
        0.0,
        1.0,
        100_001,
    )

    def path(start):
        moving = np.stack(
            [
                np.cos(angles) * start[0] - np.sin(angles) * start[1],
                np.sin(angles) * start[0] + np.cos(angles) * start[1],
            ]
        )
        return np.trapezoid(moving, dx=1e-5)

    difference = path(velocity + np.array([0.4, -0.2])) - path(velocity)
    rotated = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ difference
    found = turning(torch.tensor([turn], dtype=torch.double))[0].numpy() @ [0.0, 0.0, 0.4, -0.2]

    np.testing.assert_allclose(
        found,
        [*rotated, 0.4, -0.2],
        atol=1e-8,
    )


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_filter_of_the_turn_sees_no_deviation_on_its_path(side):
    layout = Layout(3)
    ticks = np.arange(1, 30)
    tau = 0.1
    radius = 5.0
    speed = 3.0
    angle = speed * tau * ticks / radius
    values = {
        "ticks": ticks,
        "speed": speed,
        "anchor_xx": 1.0,
        "anchor_vv": 1.0,
        "displacement_along": radius * np.sin(angle),
        "displacement_across": side * radius * (1.0 - np.cos(angle)),
        "curvature": np.array([0.0, 1.0, -1.0]) / radius,
    }
    rows = np.zeros((len(ticks), layout.width), np.float32)
    for name, value in values.items():
        block = layout.slices[name]
        width = block.stop - block.start
        rows[:, block] = layout.scales[name] * np.reshape(value, (-1, width))
    deviation = np.abs(filter_inputs(rows, tau)[..., :2]).max((0, -1))
    turn = 2 if side > 0.0 else 3

    assert deviation[turn] < 1e-4
    assert np.delete(deviation, turn).min() > 1.0


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0), "correctness": "type"},
    ],
)
def test_a_decision_after_every_row_is_that_of_whole_segments(options):
    run, found = random_run(options)
    inputs, ticks = run.inputs(found.rows, run.world.tau)
    lengths = torch.from_numpy(found.lengths)

    assert inputs.shape == (len(ticks), run.world.hypotheses + 1, 9)
    with torch.no_grad():
        whole, inside = segment_logs(
            run.net,
            torch.from_numpy(inputs),
            lengths,
        )
    expected = whole.cumsum(0).swapaxes(0, 1)[inside.T].double().numpy()
    decider = KalmanDecider(run.net, run.world)
    state = None
    for row, logs in zip(
        found.rows[:200],
        log_softmax(expected, -1),
        strict=False,
    ):
        posterior, state = decider.posterior(
            row[None],
            state,
            None,
        )
        np.testing.assert_allclose(
            posterior[0],
            np.exp(logs),
            atol=1e-3,
        )


def test_a_mirrored_trajectory_gives_the_mirrored_posterior():
    run, found = random_run({})
    layout = run.decider(run.net, run.world).layout
    mirrored = found.rows.copy()
    mirrored[:, layout.slices["displacement_across"]] *= -1.0
    one, other = (
        KalmanDecider(run.net, run.world).posterior(
            rows,
            None,
            None,
        )[0]
        for rows in (found.rows, mirrored)
    )

    np.testing.assert_allclose(
        one,
        other[:, [0, 2, 1]],
        atol=1e-5,
    )
