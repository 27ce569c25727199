"""What is shown of deciders: studies as lists of tasks, deciders and options, and their commands.

- `evaluate_command`: `hybridtrack evaluate`; `shifts`: the same in shifted and random environments.
- `compare_command`: `hybridtrack compare`; `continuation` has its plan and keeps what is finished,
  `comparison` trains, selects thresholds and scores; `flights_study` for recorded flights and
  `gliders_study` for those of gliders, whose sealed logs `sealed.json` guards;
  `simulators_study` for simulators of others, whose closed paths `sealed_simulators.json` guards; `seal`.
- `limits_command`: `hybridtrack limits`; `limits`, `departures`.
- `play_command`: `hybridtrack play`; `score_command`: `hybridtrack score`, statements of any origin.
- `dataset_command`: `hybridtrack dataset`, for offline learning; `radar_study`: filters on the radar data set.
- `tables`: of scores, the same for every task.

May import all other subpackages but `recordings`, `reproduction` and `tuning`.
"""
