"""Deciders by name: classical rules, the shipped agents, and policies in run folders."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from agents import learned
from agents.evaluation.selection import choosing_decider
from agents.interface.help_texts import shown_default
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Decider, rules
from baselines.rules.external import (
    checked_options,
    external_decider,
    find_external,
    installed_deciders,
    names_code,
)
from baselines.rules.msprt import declare_types
from hybrid_env.checks import reject, unknown
from hybrid_env.options import WorldOptions
from hybrid_env.quickest_options import QuickestOptions


def learned_decider(folder: Path, options: Any) -> Decider:
    """Return the agent of a folder, for any training algorithm.

    `options` are those of the environment to decide in.
    """
    # PyTorch is imported only here, because it loads slowly.
    from agents.learned.policy_file import load_policy

    saved = load_policy(folder)
    task = options.switches
    if saved.task != task:
        raise reject("decider", str(folder), f"a policy for {task} switches")
    return saved.load(options).changed(title=folder.name)


# Folders of the weights that come with the package, by task and name.
SHIPPED = Path(learned.__file__).parent / "weights"


def shipped_names(task: str) -> list[str]:
    """Return the names of the agents of a task that come with the package."""
    return sorted(folder.name for folder in (SHIPPED / task).iterdir())


class DeciderName(NamedTuple):
    """The parts of a decider's name, such as "ate:1e-6", "shipped:5,0" or "msprt:2%"."""

    # The name without what follows its last colon, or the object itself.
    base: Any
    threshold: float | None = None
    second: float | None = None
    # How the threshold is to be chosen, "auto" or a rate, see `choosing_decider`; else empty.
    chosen: str = ""


def parse_name(name: Any) -> DeciderName:
    """Return the parts of a decider's name. The end after a colon is a number, two numbers
    "0.001,0.01" of which the first may be missing, "auto", or a rate such as "2%" or "3/1000"; any
    other is of the name itself.
    """
    if not isinstance(name, str) or Path(name).is_dir():
        return DeciderName(name)
    base, _, text = name.rpartition(":")
    if text == "auto" or text.endswith(("%", "/1000")):
        return DeciderName(base, chosen=text)
    first, comma, second = text.partition(",")
    try:
        return DeciderName(
            base, float(first) if first or not comma else None, float(second) if comma else None
        )
    except ValueError:
        return DeciderName(name)


def policy_folder(name: str, switches: str) -> Path:
    """Return the folder of an agent of the package or of a run; for an empty name, one that does
    not exist.
    """
    if name in shipped_names(switches):
        return SHIPPED / switches / name
    return Path(name or os.devnull)


def find_decider(name: Any, options: Any) -> Decider:
    """Return a decider for the options of an environment, at the threshold of its name or else at
    its default; `Decider.at` returns it at others.

    The name is that of a rule or of an agent of the package, a run folder, "model.zip",
    "mine.py:MyRule", "package.module:Rule" or an entry point; a threshold may follow, as in
    "ate:1e-6" or "runs/ppo:-2", see `parse_name`. One that it chooses is chosen by
    `Decider.at`. Or the object itself, see `external_decider`.

    Raises:
        ArgumentError: there is no such decider or threshold.
    """
    base, threshold, second, chosen = parse_name(name)
    if chosen:
        return choosing_decider(find_decider(base, options), options, chosen)
    decider = _at_default(base, options).for_modes(options)
    if decider.hypotheses not in (None, options.hypotheses):
        here = options.hypotheses
        allowed = f"a policy for {here} hypotheses; this one is for {decider.hypotheses}"
        raise reject("decider", name, allowed)
    if second is not None:
        if not decider.second_threshold:
            raise reject("decider", name, f"{base!r} with one threshold at most")
        title = f"{decider.title}, {decider.second_threshold} {second:g}"
        decider = decider.changed(**{decider.second_threshold: second}, title=title)
    if threshold is None:
        return decider if second is None else decider.at(decider.threshold)
    if len(decider.thresholds) == 1:
        raise reject("decider", name, f"{base!r} without a threshold: it has none")
    if decider.symbol == "ticks" and threshold % 1:
        raise reject("decider", name, "a whole number after the colon")
    return decider.at(threshold)


def _at_default(name: Any, options: Any) -> Decider:
    """Return a decider whose name has no threshold."""
    if not isinstance(name, str):
        return external_decider(name, getattr(name, "__name__", type(name).__name__), options)
    check_name(name, options.switches)
    known = rules(options.switches)
    if name in known:
        return known[name].create(options)
    if name.endswith(".zip"):
        from agents.learned.exchange import exchanged_decider

        return exchanged_decider(Path(name), options)
    folder = policy_folder(name, options.switches)
    if folder.is_dir():
        return learned_decider(folder, options)
    return external_decider(find_external(name), name, options)


def check_name(name: Any, switches: str, further: Sequence[str] = ()) -> None:
    """Raise `ArgumentError` if there is no decider of a name, without loading one: that of an
    agent takes seconds. `further` are other names that are allowed.
    """
    base = parse_name(name).base
    if not isinstance(base, str):
        return
    known = (*rules(switches), *shipped_names(switches), *installed_deciders(), *further)
    if base in known or Path(base).is_dir():
        return
    if base.endswith(".zip"):
        if not Path(base).is_file():
            raise reject("decider", name, "a file that exists")
        return
    before, _, text = base.rpartition(":")
    of_policy = before.endswith(".zip")
    if not of_policy and names_code(base):
        return
    if before in known or of_policy or (before and Path(before).is_dir()):
        endings = "'auto', or a rate such as '2%'"
        raise reject("decider", name, f"after the colon a number, {endings}, not {text!r}")
    for task in {ANNOUNCED, UNKNOWN} - {switches}:
        if base in rules(task):
            raise reject("decider", name, f"a decider for {switches} switches, not {task} ones")
    files = "a run folder, model.zip or mine.py:MyRule"
    raise unknown("decider", base, known, f"expected a rule, an agent, {files}, see --help")


def is_learned(decider: Decider) -> bool:
    """Return whether a decider has a network, or a policy of a learning library."""
    bases = [base.__module__ for base in type(decider).__mro__]
    learned_base = any(base.startswith(learned.__name__) for base in bases)
    return learned_base or hasattr(getattr(decider, "model", None), "policy")


def distinct_titles(names: Sequence[Any], titles: Sequence[str]) -> list[str]:
    """Return the titles of deciders; those with the title of another are called by their names."""
    bases = [str(parse_name(name).base) for name in names]
    same = Counter(title for _, title in set(zip(bases, titles, strict=True)))
    return [title if same[title] == 1 else base for base, title in zip(bases, titles, strict=True)]


def load_decider(name: Any, options: Any) -> Decider:
    """Return the decider of a name, see `find_decider`; refuse an environment without the
    options that it needs.
    """
    decider = find_decider(name, options)
    for key, value in decider.options.items():
        if str(getattr(options, key)) != str(value):
            raise reject(key, getattr(options, key), f"{value!r} for the decider {name!r}")
    # A decider that chooses its threshold does it here.
    return for_actions(decider.at(decider.threshold), options)


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
        return declare_types(decider, options.types)
    raise reject("actions", actions, "'all' or 'types': deciders declare hypotheses")


def needed_options(name: Any, switches: str) -> Mapping[str, Any]:
    """Return the options of an environment that a classical rule needs, see `Decider.options`."""
    base = parse_name(name).base
    if rule := rules(switches).get(base):
        return rule.attribute("options")
    kind = QuickestOptions if switches == UNKNOWN else WorldOptions
    return checked_options(find_external(base), base, kind)


@dataclass(kw_only=True)
class ErrorArguments:
    """Flag of the commands that run deciders at one threshold each."""

    error: Annotated[str | None, shown_default("the usual threshold")] = None
    """Rate to hold: '2%' of wrong decisions, or with unknown switches '2/1000', wrong changes in
    ticks. The threshold is chosen for it by simulation, as with the name 'msprt:2%'.
    """

    def at_error(self, name: str) -> str:
        """Return the name of a decider with the rate that is asked for."""
        return name if self.error is None else f"{name}:{self.error}"
