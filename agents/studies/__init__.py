"""What is shown of deciders: studies as lists of tasks, deciders and options, and their commands.

- `evaluate_command`: `hybridtrack evaluate`; `shifts`: the same in shifted and random environments.
- `compare_command`: `hybridtrack compare`; `continuation` has its plan and keeps what is finished,
  `comparison` trains, selects thresholds and scores; `flights_study` for recorded flights and
  `gliders_study` for those of gliders, whose sealed logs `sealed.json` guards, with `flights_report`;
  `simulators_study` for simulators of others, whose closed paths `sealed_simulators.json` guards; `seal`.
- `limits_command`: `hybridtrack limits`; `limits`, `limits_report`.
- `play_command`: `hybridtrack play`; `episodes`.
- `score_command`: `hybridtrack score`, statements of any origin; `score_report`.
- `dataset_command`: `hybridtrack dataset`, for offline learning.
- `tables`: of scores, the same for every task.

May import all other subpackages but `recordings`, `reproduction` and `tuning`.
"""
