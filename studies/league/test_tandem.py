"""MSPRT-TANDEM: the TANDEM formula, the loss, and ratios that are known in closed form."""

import numpy as np
import pytest
import torch
from scipy.special import log_softmax

from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from hybrid_env import Layout
from studies.league.families import recipe_file
from studies.league.reward import Explorer, reward_inputs
from studies.league.tandem import TandemDecider, WindowNet, log_ratios, tandem_loss, windows_of

ENV = "hybrid_env:HybridTrackPublished-v0"
MEANS = torch.eye(3)
"""Of the normal vectors with unit covariance in the sequences of three hypotheses."""


def gaussian_sequences(count, length, generator):
    """Vectors (count x length, 3), lengths and hypotheses of sequences, and their exact
    log-likelihoods (n, 3).
    """
    modes = torch.randint(
        3,
        (count,),
        generator=generator,
    )
    vectors = MEANS[modes].repeat_interleave(length, 0)
    vectors = vectors + torch.randn(vectors.shape, generator=generator)
    each = vectors @ MEANS.T - 0.5 * MEANS.square().sum(-1)
    exact = (
        each.view(
            count,
            length,
            3,
        )
        .cumsum(1)
        .flatten(
            0,
            1,
        )
    )
    return vectors, torch.full((count,), length), modes, exact


def ticks_of(lengths):
    return torch.cat([torch.arange(1, n + 1) for n in lengths.tolist()])


@pytest.mark.parametrize("order", [0, 1, 4])
def test_exact_posteriors_of_windows_give_the_exact_ratios(order):
    vectors, lengths, _, exact = gaussian_sequences(
        4,
        9,
        torch.Generator().manual_seed(0),
    )
    ticks = ticks_of(lengths)
    longer, shorter = windows_of(
        vectors[:, None],
        ticks,
        order,
    )
    each = [part[:, 0].unflatten(-1, (order + 1, 4))[..., :3] for part in (longer, shorter)]
    marks = longer[:, 0].unflatten(-1, (order + 1, 4))[..., 3]

    assert torch.equal(marks.sum(-1), ticks.clamp(max=order + 1).float())
    posteriors = [torch.log_softmax(part.sum(1) @ MEANS.T, -1) for part in each]
    found = log_ratios(
        *posteriors,
        ticks,
        order,
    )
    np.testing.assert_allclose(
        log_softmax(found, -1),
        log_softmax(exact, -1),
        atol=1e-5,
    )


@torch.no_grad()
def test_the_loss_is_the_log_sum_exp_of_the_ratios_and_that_of_the_windows():
    generator = torch.Generator().manual_seed(1)
    vectors, lengths, modes, _ = gaussian_sequences(
        6,
        4,
        generator,
    )
    net = WindowNet(
        3,
        3,
        8,
        1,
    )
    ticks = ticks_of(lengths)
    each = modes.repeat_interleave(4)[:, None]
    longer, shorter = (
        net(part)
        for part in windows_of(
            vectors,
            ticks,
            1,
        )
    )
    ratios = log_ratios(
        longer,
        shorter,
        ticks,
        1,
    )
    others = torch.exp(ratios - ratios.gather(1, each)).sum(1) - 1.0
    windows = longer.gather(1, each).mean() + shorter.gather(1, each)[ticks > 1].mean()
    expected = float(torch.log1p(others).mean() - windows)

    assert float(
        tandem_loss(
            net,
            vectors,
            lengths,
            modes,
        )
    ) == pytest.approx(expected, rel=1e-5)


def learned_ratios(updates, order, seed=0):
    """Learned and exact differences of log-likelihoods on other sequences of ten vectors, (n,
    3).
    """
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    generator = torch.Generator().manual_seed(seed)
    net = WindowNet(
        3,
        3,
        64,
        order,
    )
    optimizer = torch.optim.Adam(net.parameters(), 3e-3)
    schedule = torch.optim.lr_scheduler.LinearLR(
        optimizer,
        1.0,
        0.02,
        updates,
    )
    for _ in range(updates):
        vectors, lengths, modes, _ = gaussian_sequences(
            100,
            10,
            generator,
        )
        loss = tandem_loss(
            net,
            vectors,
            lengths,
            modes,
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    vectors, lengths, _, exact = gaussian_sequences(
        2000,
        10,
        generator,
    )
    ticks = ticks_of(lengths)
    with torch.no_grad():
        found = log_ratios(
            *(
                net(part)
                for part in windows_of(
                    vectors,
                    ticks,
                    order,
                )
            ),
            ticks,
            order,
        )
    return found - found.roll(1, 1), exact - exact.roll(1, 1)


def normalized_error(found, exact):
    return float((found - exact).square().mean() / exact.square().mean())


def test_ratios_of_gaussian_sequences_are_learned_in_seconds():
    assert normalized_error(*learned_ratios(600, 1)) < 0.05


@pytest.mark.study
@pytest.mark.parametrize("order", [0, 1, 3])
def test_ratios_of_gaussian_sequences_are_learned_within_five_per_cent(order):
    found, exact = learned_ratios(6000, order)
    ratio = (found - exact).abs().mean() / exact.abs().mean()

    assert ratio < 0.05
    # They saturate where the training has few errors.
    large = exact.abs() > 8.0
    assert 0.9 < float((found[large].abs() / exact[large].abs()).mean()) < 1.05


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0), "correctness": "type"},
    ],
)
def test_a_decision_after_every_row_is_that_of_whole_segments(options):
    run = make_run(
        ENV,
        options,
        load_recipe(
            recipe_file("tandem"),
            ENV,
            ("n_envs=6", "hidden=8"),
        ),
    )
    torch.nn.init.normal_(
        run.net.output.weight,
        std=0.5,
    )
    found = Explorer(
        TandemDecider(run.net, run.world),
        np.random.default_rng(1),
    ).segments(
        run.env,
        5,
    )

    assert np.array_equal(found.modes == found.declared, found.rewarded) or options
    ticks = torch.from_numpy(
        Layout.of_rows(found.rows).read(found.rows, "ticks").round().astype(np.int64)
    )
    inputs = torch.from_numpy(reward_inputs(found.rows, run.world.tau)[0])
    order = run.net.order
    with torch.no_grad():
        whole = log_ratios(
            *(
                run.net(part)
                for part in windows_of(
                    inputs,
                    ticks,
                    order,
                )
            ),
            ticks,
            order,
        )
    decider = TandemDecider(run.net, run.world)
    state = None
    for row, expected in zip(
        found.rows[:200],
        log_softmax(whole.double().numpy(), -1),
        strict=False,
    ):
        posterior, state = decider.posterior(
            row[None],
            state,
            None,
        )
        np.testing.assert_allclose(
            np.log(posterior[0]),
            expected,
            atol=1e-3,
        )
