"""Search for hyper-parameters of a recipe with Optuna.

`ranges` reads what is searched, `trial` trains one agent and may end it early, `search` asks Optuna what to
try, keeps the trials in a folder and continues from them, and `command` is `hybridtrack tune`, which writes
the best trial as a recipe.

May import: `hybrid_env`, `agents.interface`, `agents.training`.
"""
