"""Learned deciders: networks, policies and their files.

- `sequence`: the recurrent network that corrects the bank's log-likelihood ratios.
- `policy`: an actor of Stable-Baselines3 as a decider.
- `stopping`: an actor that decides when to stop, from the belief state of the sequence network.
- `features`: selects the quantities that an actor observes.
- `network_settings`: the limits on the sizes of networks.
- `policy_file`: reads and writes weights and their card.
- `shipped/`: the weights that come with the package.

All of them map observation rows to actions through the interface of `baselines.deciders.decider`.

May import: `hybrid_env`, `baselines.deciders`, `agents.interface`.
"""
