from agents.cli import run_command as run_command
from agents.functions import compare as compare
from agents.functions import evaluate as evaluate
from agents.functions import load as load
from agents.functions import train as train
from agents.recordings.tracking import track_recording as track_recording
from agents.training.vec_env import as_vec_env as as_vec_env
