"""The commands `hybridtrack train | evaluate | compare | play | track | score`, one file each."""

# Each has a file of its own, which is imported when it is needed.
COMMANDS = ("train", "evaluate", "compare", "play", "track", "score")
EXAMPLES = {
    "": """
hybridtrack play ate --out episode.gif             # watch the classical rule
hybridtrack train --out runs/ppo                   # half a minute
hybridtrack evaluate ate shipped runs/ppo          # on the same episodes
hybridtrack compare --help                         # its flags and examples
hybridtrack --version""",
    "train": """
hybridtrack train --out runs/ppo --seed 1
hybridtrack train --recipe dqn --out runs/dqn --measurement-variance 0.5
hybridtrack train --resume runs/ppo --steps 3000000
hybridtrack train --set n_envs=128 policy_kwargs.net_arch=[32]
hybridtrack train --modes 'straight, stop, left 5, right 5, accelerate 1'""",
    "evaluate": """
hybridtrack evaluate ate:1e-6 msprt:0.02 fixed:30 shipped
hybridtrack evaluate runs/ppo:-1 --episodes 3000 --out ppo.json
hybridtrack evaluate shipped propagated --noise 'outliers 0.05'
hybridtrack evaluate shipped beam threshold:0.7 --env HybridTrackQuickest-v0""",
    "compare": """
hybridtrack compare                                # PPO and the usual rules
hybridtrack compare ate msprt shipped runs/anchor --measurement-variance 1
hybridtrack compare ate msprt ppo --training-seeds 5 --out results/seeds
hybridtrack compare ate mine.py:MyRule model.zip
hybridtrack compare --no-curves --episodes 300     # a first look
hybridtrack compare ate msprt-type msprt --env HybridTrackBank-v0""",
    "play": """
hybridtrack play shipped                           # in a window
hybridtrack play msprt:0.02 --out episode.gif
hybridtrack play beam --env HybridTrackQuickest-v0 --out episode.png
hybridtrack play --scheme 'L60r3 R75r5 S50' --radii 3 5 --record flight.csv
hybridtrack play --modes 'straight, stop' --scheme '9 stop' --record stop.csv""",
    "track": """
hybridtrack track flight.csv --lengths 50 --radii 3 5 10
hybridtrack track flight.csv --lengths 60 75 50 --radii 3 5 --unit km""",
    "score": """
hybridtrack score truth.csv imm.csv mine.csv --out score.json
hybridtrack score truth.csv mine.csv --columns time=1 mode=4 --per min""",
}
"""Lines below the help of each command; a test parses them."""
