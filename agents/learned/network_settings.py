"""The settings of networks in recipes and cards, and their limits."""

from collections.abc import Mapping
from typing import Any

from hybrid_env.checks import check_flag, check_integer, reject

LARGEST_HIDDEN = 512  # units of a hidden layer of the anchor agent
LARGEST_LAYER = 1024
MOST_LAYERS = 8
ACTOR_CRITIC_SETTINGS = ("net_arch", "ortho_init")
LSTM_SETTINGS = ("lstm_hidden_size", "n_lstm_layers", "enable_critic_lstm")


def check_policy_kwargs(policy_kwargs: Any, recurrent: bool) -> None:
    """Check the keyword arguments of an actor-critic policy of Stable-Baselines3 or sb3-contrib.

    Raises:
        ArgumentError: an unknown name, a wrong type, or a network that is too large.
    """
    known = ACTOR_CRITIC_SETTINGS + (LSTM_SETTINGS if recurrent else ())
    if not isinstance(policy_kwargs, Mapping) or any(name not in known for name in policy_kwargs):
        raise reject("policy_kwargs", policy_kwargs, f"a mapping of {', '.join(known)}")
    layers = policy_kwargs.get("net_arch", [1])
    if not isinstance(layers, list) or not 1 <= len(layers) <= MOST_LAYERS:
        raise reject("net_arch", layers, f"a list of one to {MOST_LAYERS} layers")
    for units in layers:
        check_integer("net_arch", units, maximum=LARGEST_LAYER)
    for name, largest in (("lstm_hidden_size", LARGEST_LAYER), ("n_lstm_layers", 2)):
        check_integer(name, policy_kwargs.get(name, 1), maximum=largest)
    for name in ("ortho_init", "enable_critic_lstm"):
        check_flag(name, policy_kwargs.get(name, True))
