"""What is shown of deciders: studies as lists of tasks, deciders and options, and their commands.

- `evaluate_command`: `hybridtrack evaluate`; `shifts`: the same in shifted and random environments.
- `compare_command`: `hybridtrack compare`; `plan` has its settings, `comparison` trains, selects thresholds
  and scores, `continuation` keeps what is finished; `flight_arguments`, `flights_study`, `flights_report` for
  recorded flights.
- `limits_command`: `hybridtrack limits`; `limits`, `limits_report`, `limits_figure`.
- `play_command`: `hybridtrack play`; `episodes`, `animation`.
- `score_command`: `hybridtrack score`, statements of any origin; `score_report`.
- `tables`: of scores, the same for every task.

May import all other subpackages but `recordings`, `reproduction` and `tuning`.
"""
