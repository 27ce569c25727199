"""Pictures of a running episode, drawn by matplotlib and shown by pygame.

`modes` names and colours the hypotheses; `history` keeps every tick of the episode; `figure` draws it;
`window` shows frames on a screen. Data flows history -> figure -> window.

May import: options and checks of `hybrid_env`, column names of `hybrid_env.core.records`.
"""
