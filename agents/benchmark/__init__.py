"""Speed compared with common alternatives: `hybridtrack bench`.

`command` has the flags. `measurements` lists the groups, which are in `environments`, `filters`, `online`,
`training` and `scaling`; `timing` measures two functions in turn; `peers` has banks written without this
package; `report` writes table and figure.

May import: `hybrid_env`, `baselines`, and `agents.interface`, `learned`, `evaluation`, `training`; no other
study.
"""
