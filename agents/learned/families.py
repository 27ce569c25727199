"""Trained agents as families of deciders, for every task and every training algorithm."""

from pathlib import Path
from typing import Any

from baselines.rules.decider import ANNOUNCED, FLIGHTS, UNKNOWN, DeciderFamily
from hybrid_env.checks import reject

TASKS = {ANNOUNCED: "known switch moments", UNKNOWN: "unknown switch moments", FLIGHTS: "recorded flights"}
"""What agents decide, in messages."""


def learned_family(folder: Path, options: Any = None) -> DeciderFamily:
    """Return the agent of a folder at any threshold, for any training algorithm.

    Args:
        folder: with weights and card.
        options: of the environment to decide in; None for recorded flights.

    Raises:
        ArgumentError: the folder cannot be read, or its agent is for another task.
    """
    # PyTorch is imported only here, because it loads slowly
    from agents.learned.policy_file import card_task, load_network, load_policy

    weights, card = load_policy(folder)
    task = FLIGHTS if options is None else options.switches
    if card_task(card) != task:
        raise reject("decider", str(folder), f"a policy for {TASKS[task]}")
    kind: Any
    match card["recipe"]["entry"]["algo"]:
        case "anchor":
            from agents.learned.anchor_decider import AnchorDecider

            kind = AnchorDecider
        case "statements":
            from agents.learned.statement_decider import StatementDecider

            kind = StatementDecider
        case "flights":
            from agents.learned.flight_decider import FlightAgent

            kind = FlightAgent
        case _:
            from agents.learned.policy import ACTORS, load_actor

            return ACTORS[task](load_actor(folder, weights, card)).trained(folder.name)
    return kind.trained(folder.name, load_network(folder, weights, card, kind.network), options)
