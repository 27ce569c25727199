from baselines.adapters.skchange_detector import ModeDetector as ModeDetector
from baselines.adapters.stone_soup import IMMPredictor as IMMPredictor
from baselines.adapters.stone_soup import IMMUpdater as IMMUpdater
from baselines.adapters.stone_soup import decide_track as decide_track
from baselines.adapters.stone_soup import measured_position as measured_position
