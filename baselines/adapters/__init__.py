"""Parts of the package behind the interfaces of other libraries, one file for each library.

`stone_soup` needs the extra `stonesoup`, `skchange_detector` the extra `skchange`. Names are loaded when they
are first used.

May import: `hybrid_env`, and `estimation`, `rules` and `recordings` of `baselines`. Nothing imports it.
"""

from typing import TYPE_CHECKING

from hybrid_env.lazy_names import lazy_names

if TYPE_CHECKING:
    from baselines.adapters.skchange_detector import ModeDetector as ModeDetector
    from baselines.adapters.stone_soup import IMMPredictor as IMMPredictor
    from baselines.adapters.stone_soup import IMMUpdater as IMMUpdater
    from baselines.adapters.stone_soup import decide_track as decide_track
    from baselines.adapters.stone_soup import measured_position as measured_position
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "skchange_detector": "ModeDetector",
            "stone_soup": "IMMPredictor IMMUpdater decide_track measured_position",
        },
    )
