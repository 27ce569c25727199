"""Search for hyper-parameters of a recipe with Optuna: what is searched (`ranges`), and the trials (`search`)."""
