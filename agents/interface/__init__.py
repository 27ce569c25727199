"""Input and output shared by all commands.

`world_arguments` defines the environment options as command-line flags, `help_texts` what `--help` prints,
`progress` the progress display, `input_files` bounded reading of JSON and YAML, `output_files` atomic writing
of files, also of CSV and JSON, and `parallel` independent calls in several processes or on a Ray cluster,
with their flags.

May import: `hybrid_env`. Never another subpackage of `agents`.
"""
