"""Learned deciders: networks, policies and their files.

- `sequence`: the recurrent network that corrects the likelihoods of filters of its own, and its decider.
- `anchor_net`: the network that predicts the distribution of the anchor error, from which they start.
- `dimensionless`: the inputs of both networks, without units.
- `policy`: an actor of Stable-Baselines3 as a decider.
- `features`: selects the quantities that an actor observes.
- `network_settings`: the limits on the sizes of networks.
- `policy_file`: reads and writes weights and their card.
- `shipped/`: the weights that come with the package.

All of them map observation rows to actions through the interface of `baselines.deciders.decider`.

May import: `hybrid_env`, `baselines.deciders`, `agents.interface`.
"""
