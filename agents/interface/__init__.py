"""Input and output shared by all commands.

`world_arguments` defines the environment options as command-line flags, `help_texts` what `--help` prints,
`progress` the progress display, `input_files` bounded reading of JSON and YAML, `output_files` atomic writing
of files, also of CSV and JSON, `parallel` independent calls in several processes or on a Ray cluster,
`parallel_arguments` its flags, `decider_colours` the colour and marker of each decider, and `curve_labels`
labels beside the curves of figures.

May import: `hybrid_env`. Never another subpackage of `agents`.
"""
