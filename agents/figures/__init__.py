"""What the figures of all studies have in common. They are drawn from plain data, not from results.

- `canvas`: an empty figure, and the style of its axes.
- `decider_colours`: colour and marker of each decider, the same in every figure.
- `curves`: panels of curves, such as operating curves.
- `tracks`: a track in the plane by its modes, and modes over time as bars.

May import: `hybrid_env`, `agents.interface`, and of `baselines` estimates, and rules, which name their colours.
"""
