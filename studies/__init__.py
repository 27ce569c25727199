"""Studies: one folder for each question, with its method, result and picture in `README.md`.

A study uses the public names of the packages, as any user does, and is not part of the wheel.
`python -m studies` lists the studies, `python -m studies.NAME --help` shows the options of one.
"""
