"""Deciders by name: classical rules, the shipped agents, and policies in run folders."""

import dataclasses
import functools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from agents import learned
from agents.interface.help_texts import shown_default
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, DeciderFamily, rules
from baselines.rules.msprt import TypeDeclarations
from baselines.rules.own import find_own, own_family, own_names, own_options
from hybrid_env.checks import reject
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions

TASKS = {
    ANNOUNCED: "known switch moments",
    UNKNOWN: "unknown switch moments",
}
"""What agents decide, in messages."""


def learned_family(folder: Path, options: Any) -> DeciderFamily:
    """Return the agent of a folder at any threshold, for any training algorithm.

    `options` are those of the environment to decide in.
    """
    # PyTorch is imported only here, because it loads slowly.
    from agents.algorithms import find_algorithm
    from agents.learned.policy_file import card_task, load_policy

    weights, card = load_policy(folder)
    task = options.switches
    if card_task(card) != task:
        raise reject("decider", str(folder), f"a policy for {TASKS[task]}")
    algorithm = find_algorithm(card["recipe"]["entry"]["algo"])
    family: DeciderFamily = algorithm.load(folder, weights, card, options)
    return family


# Endings of the files of policies that other libraries write.
EXCHANGED = (".zip", ".onnx")
SHIPPED = "shipped"
# Folders of the weights that come with the package, by task and name.
WEIGHTS = Path(learned.__file__).parent / "weights"


def shipped_names(*tasks: str) -> list[str]:
    """Return the names of the agents of some tasks that come with the package."""
    folders = (folder for task in tasks for folder in sorted((WEIGHTS / task).glob("*")))
    return list(dict.fromkeys(folder.name for folder in folders))


def split_threshold(name: Any) -> tuple[Any, float | None]:
    """Return the name of a decider, or the object itself, and the number after its colon or
    None.
    """
    if not isinstance(name, str):
        return name, None
    base, colon, text = name.rpartition(":")
    if not colon or Path(name).is_dir() or (base.endswith(".py") and text.isidentifier()):
        return name, None
    try:
        return base, float(text)
    except ValueError:
        return name, None


def base_name(name: Any) -> Any:
    """Return the name of a decider without a threshold and without one that it chooses, or the
    object itself.
    """
    from agents.evaluation.chosen_threshold import chosen_rule

    chosen = chosen_rule(name) if isinstance(name, str) else None
    return split_threshold(rule_name(name))[0] if chosen is None else chosen[0]


def rule_name(name: Any) -> Any:
    """Return the name without a second threshold, as "ate" of "ate:0.001,0.01", or the object
    itself.
    """
    both = _two_thresholds(name) if isinstance(name, str) else None
    return name if both is None else both[0]


def policy_folder(name: str, switches: str) -> Path:
    """Return the folder of an agent of the package or of a run; for an empty name, one that does
    not exist.
    """
    if name in shipped_names(switches):
        return WEIGHTS / switches / name
    return Path(name or os.devnull)


def is_own(name: Any) -> bool:
    """Return whether a decider is an object, or the name of one in a file, module or entry point
    of a user.
    """
    return not isinstance(name, str) or find_own(name) is not None


def is_brought(name: Any) -> bool:
    """Return whether a decider is the folder or file of a policy, or one of a user, see
    `is_own`.
    """
    path = Path(name or os.devnull) if isinstance(name, str) else Path(os.devnull)
    return path.is_dir() or (path.suffix in EXCHANGED and path.is_file()) or is_own(name)


def find_family(name: Any, options: Any) -> DeciderFamily:
    """Return a decider at any threshold, for the options of an environment.

    The name is that of a rule or of an agent of the package, a run folder, "mine.py:MyRule",
    "package.module:Rule" or an entry point, without a threshold or with one that it chooses, see
    `chosen_rule`; or the object itself, see `own_family`.
    """
    if not isinstance(name, str):
        return own_family(name, getattr(name, "__name__", type(name).__name__), options)
    from agents.evaluation.chosen_threshold import chosen_family, chosen_rule

    chosen = chosen_rule(name)
    if chosen is not None:
        return chosen_family(find_family(chosen[0], options), options, chosen[1])
    known = rules(options.switches)
    if name in known:
        return known[name].family(options)
    both = _two_thresholds(name)
    if both is not None and both[0] in known:
        return _family_at(known[both[0]], options, *both)
    folder = policy_folder(name, options.switches)
    if Path(name).suffix in EXCHANGED:
        from agents.learned.exchange import exchanged_family

        return exchanged_family(Path(name), options)
    if not folder.is_dir():
        own = find_own(name)
        if own is not None:
            return own_family(own, name, options)
        agents = shipped_names(options.switches)
        names = ", ".join(map(repr, (*known, *agents, *own_names())))
        allowed = (
            f"{names}, a run folder, model.zip, policy.onnx or mine.py:MyRule, and optionally"
            " ':number'"
        )
        raise reject("decider", name, allowed)
    family = learned_family(folder, options)
    if name in shipped_names(options.switches):
        family = dataclasses.replace(family, name=name)
    if family.hypotheses not in (None, options.hypotheses):
        allowed = (
            f"a policy for {options.hypotheses} hypotheses; this one is for {family.hypotheses}"
        )
        raise reject("decider", name, allowed)
    return family


def _two_thresholds(name: str) -> tuple[str, str, str] | None:
    """Return rule, first and second threshold of "ate:0.001,0.01" or "ate:,0.01"; None for
    another form.
    """
    base, colon, text = name.partition(":")
    first, comma, second = text.partition(",")
    return (base, first, second) if colon and comma and second else None


def _family_at(
    rule: type[Decider],
    options: Any,
    name: str,
    first: str,
    second: str,
) -> DeciderFamily:
    """Return a rule with a given second threshold: at a given first one, or at any if there is
    none.
    """
    whole = f"{name}:{first},{second}"
    if not rule.second_threshold:
        raise reject("decider", whole, f"{name!r} with one threshold at most")
    try:
        numbers = [float(text) for text in (first, second) if text]
    except ValueError:
        raise reject("decider", whole, "numbers after the colon") from None
    family = rule.family(options)
    make: Any = functools.partial(rule, **{rule.second_threshold: numbers[-1]})
    title = f"{family.name}, {rule.second_threshold} {numbers[-1]:g}"
    family = dataclasses.replace(family, name=title, make=make)
    make(family.default)
    if first:
        make(numbers[0])
        family = dataclasses.replace(family, thresholds=(numbers[0],), default=numbers[0])
    return family


def distinct_titles(names: Sequence[Any], titles: Sequence[str]) -> list[str]:
    """Return the titles of deciders; one that is not of the package and has the title of another
    is called by its name.

    The name is then the path of a file or folder. Raises `ArgumentError` where objects, which have
    no names, have equal titles.
    """
    bases = [base_name(name) for name in names]
    found = []
    for base, title in zip(bases, titles, strict=True):
        same = [other for other, theirs in zip(bases, titles, strict=True) if theirs == title]
        if all(other is base or other == base for other in same):
            found.append(title)
        elif not isinstance(base, str):
            raise reject("deciders", title, "different titles of deciders that are objects")
        else:
            found.append(base if base.endswith(".yml") or is_brought(base) else title)
    return found


def find_decider(name: Any, options: Any) -> tuple[DeciderFamily, float]:
    """Return the family and the threshold of "ate", "ate:1e-6", "beam:0.7", "runs/ppo" or
    "runs/ppo:-2".
    """
    base, threshold = split_threshold(name)
    family = find_family(base, options)
    whole = family.symbol == "ticks"
    if threshold is None:
        return family, family.default
    if len(family.thresholds) == 1:
        raise reject("decider", name, f"{base!r} without a threshold: it has none")
    if not np.isfinite(threshold) or (whole and threshold % 1):
        raise reject(
            "decider",
            name,
            f"{'a whole' if whole else 'a finite'} number after the colon",
        )
    return family, threshold


def load_decider(name: Any, options: Any) -> Decider:
    """Return the decider of a name, see `find_decider`; refuse an environment without the
    options that it needs.
    """
    family, threshold = find_decider(name, options)
    for key, value in family.options.items():
        if str(getattr(options, key)) != str(value):
            raise reject(key, getattr(options, key), f"{value!r} for the decider {name!r}")
    return for_actions(family.make(threshold), options)


def for_actions(decider: Decider, options: Any) -> Decider:
    """Return a decider that declares hypotheses for the actions of an environment."""
    actions = getattr(options, "actions", "all")
    if actions == "all":
        return decider
    space = getattr(getattr(decider, "model", None), "action_space", None)
    if space is not None and int(space.n) == options.action_count:
        # A model of a learning library, trained with these actions.
        return decider
    if actions == "types":
        return TypeDeclarations(decider, options.hypotheses)
    raise reject("actions", actions, "'all' or 'types': deciders declare hypotheses")


def needed_options(name: Any, switches: str) -> Mapping[str, Any]:
    """Return the options of an environment that a classical rule needs, see `Decider.options`."""
    base = base_name(name)
    rule = rules(switches).get(base)
    kind = QuickestOptions if switches == UNKNOWN else WorldOptions
    return own_options(find_own(base), base, kind) if rule is None else rule.options


@dataclass(kw_only=True)
class ErrorArguments:
    """Flag of the commands that run deciders at one threshold each."""

    error: Annotated[str | None, shown_default("the usual threshold")] = None
    """Rate to hold: '2%' of wrong decisions, or with unknown switches '2/1000', wrong changes in
    ticks. The threshold is chosen for it by simulation, as with the name 'msprt:2%'.
    """

    def at_error(self, name: str) -> str:
        """Return the name of a decider with the rate that is asked for."""
        if self.error is None:
            return name
        from agents.evaluation.chosen_threshold import RATES

        if not self.error.endswith(tuple(RATES.values())):
            raise reject(
                "error",
                self.error,
                "a rate such as '2%', or '2/1000' with unknown switches",
            )
        if base_name(name) != name:
            raise reject("decider", name, "a name without a threshold, with --error")
        return f"{name}:{self.error}"
