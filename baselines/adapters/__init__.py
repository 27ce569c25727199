"""Parts of the package behind the interfaces of other libraries, one file for each library.

`stone_soup` needs the extra `stonesoup`, `skchange_detector` the extra `skchange`.

May import: `hybrid_env`, and `estimation`, `rules` and `recordings` of `baselines`. Nothing imports it.
"""
