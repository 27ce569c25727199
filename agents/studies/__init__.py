"""What is shown of deciders: studies as lists of tasks, deciders and options, and their commands.

The sealed logs of gliders are guarded by `sealed.json`, the closed paths of simulators by
`sealed_simulators.json`.
"""
