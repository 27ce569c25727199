"""Classical decision rules: Wald's SPRT, MSPRT and gap rule, fixed decision time; ATE on
recordings. For unknown switch moments: a threshold, CUSUM, Shiryaev-Roberts, the windowed
generalized likelihood ratio, the detector of Golubkov 2020 and a beam of histories. `OnlineTracker`
puts a rule behind a live sensor. Names are loaded when they are first used.
"""

from hybrid_env.extras import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
