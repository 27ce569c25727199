"""Learned deciders: networks, policies and their files.

- `anchor_decider`: filters that start from learned distributions of the anchor error, as a decider.
- `track_filters`: these filters.
- `anchor_net`: the networks that predict the distribution of the anchor error, and what a wrong radius costs
  in the next segment.
- `dimensionless`: the inputs of both networks, without units.
- `distilled`: the shipped agent as a small network on the present row.
- `transformer_net`: attention over the measurements of a segment, without filters, and it as a decider.
- `tandem_net`, `tandem_decider`: MSPRT-TANDEM, learned log-likelihood ratios.
- `kalman_net`, `kalman_decider`: KalmanNet, filters with a learned gain.
- `reward_net`: the network that learns from rewards alone; `reward_decider`: it as a decider; `posterior_decider`:
  its base class and that of `anchor_decider`.
- `policy`: an actor of Stable-Baselines3 as a decider, which declares modes or states them.
- `statement_net`: a recurrent network that states the present mode, and its inputs.
- `rhythm_decider`: the same on a beam that learns habits within the episode.
- `statement_decider`: this network as a decider in an environment; `flight_decider`: on recorded flights;
  `glider_decider`: on those of gliders.
- `features`: selects the quantities that an actor observes.
- `policy_file`: reads and writes weights and their card; the limits on the sizes of networks.
- `shipped/`, `shipped_quickest/`, `shipped_rhythm/`, `shipped_flights/`, `shipped_gliders/`: weights of the package.

All of them map observation rows to actions through the interface of `baselines.rules.decider`.

May import: `hybrid_env`, `baselines`, `agents.interface`.
"""
