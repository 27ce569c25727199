"""What the commands share with their user.

`world_arguments` has the options of a world as command-line flags, `progress` the live display,
`output_files` files that are whole or absent, `recording_files` recordings as CSV, `decider_colours` one
colour for each decider in every figure.

May import: `hybrid_env`. Never another room of `agents`.
"""
