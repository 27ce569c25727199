"""Search for hyper-parameters of a recipe with Optuna.

`ranges` reads what is searched; `search` asks Optuna what to try, trains one agent for each trial, which may
end early, keeps the trials in a folder and continues from them; and `command` is `hybridtrack tune`, which
writes the best trial as a recipe.

May import: `hybrid_env`, `agents.interface`, `agents.training`.
"""
