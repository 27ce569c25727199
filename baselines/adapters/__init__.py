"""Parts of the package behind the interfaces of other libraries: `stone_soup` needs the extra
`stonesoup`, `skchange_detector` the extra `skchange`. May import: `hybrid_env`, and `estimation`,
`rules` and `recordings` of `baselines`. Nothing imports it.
"""

from hybrid_env.extras import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
