"""Trained agents as families of deciders."""

from pathlib import Path
from typing import Any

from agents.learned.policy_file import card_layout, load_policy
from baselines.rules.decider import DeciderFamily
from baselines.rules.msprt import FEW_ALPHAS
from hybrid_env.checks import reject
from hybrid_env.observation import Layout, QuickestLayout

LOG_ODDS = (
    -10.0,
    -8.0,
    -6.0,
    -5.0,
    -4.0,
    -3.0,
    -2.0,
    -1.5,
    -1.0,
    -0.5,
    0.0,
    0.5,
    1.0,
    1.5,
    2.0,
    2.5,
    3.0,
    4.0,
)
MARGINS = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0)


def policy_family(name, decider):
    return DeciderFamily(name, "log-odds", LOG_ODDS, 0.0, decider.with_threshold, decider.hypotheses)


def anchor_family(name, net, world):
    from agents.learned.anchor_decider import AnchorDecider

    return DeciderFamily(name, "alpha", FEW_ALPHAS, 0.02, lambda alpha: AnchorDecider(net, world, alpha))


def statement_policy_family(name, decider):
    thresholds = tuple(margin for margin in MARGINS if margin >= 0.0)
    return DeciderFamily(name, "log-odds", thresholds, 0.0, decider.with_threshold, decider.hypotheses)


def statement_net_family(name, net, options):
    from agents.learned.statement_decider import StatementDecider

    return DeciderFamily(
        name, "log-odds", MARGINS, 0.0, lambda margin: StatementDecider(net, options, margin)
    )


def learned_family(folder: Path, options: Any) -> DeciderFamily:
    weights, card = load_policy(folder)
    layout = {"announced": Layout, "unknown": QuickestLayout}[options.switches]
    if card_layout(card) is not layout:
        raise reject(
            "decider",
            str(folder),
            f"a policy for {'known' if layout is Layout else 'unknown'} switch moments",
        )
    algo = card["recipe"]["entry"]["algo"]
    if algo == "anchor":
        from agents.learned.anchor_decider import load_anchor

        return anchor_family(folder.name, load_anchor(folder, weights, card), options)
    if algo == "statements":
        from agents.learned.statement_decider import load_statements

        return statement_net_family(folder.name, load_statements(folder, weights, card), options)
    from agents.learned.policy import PolicyDecider, load_actor
    from agents.learned.statement_policy import StatementPolicyDecider

    actor = load_actor(folder, weights, card)
    if layout is Layout:
        return policy_family(folder.name, PolicyDecider(actor))
    return statement_policy_family(folder.name, StatementPolicyDecider(actor))
