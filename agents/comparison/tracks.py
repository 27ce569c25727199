"""What a decider declares or states on one simulated track."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.figures.timelines import UNDECIDED
from agents.figures.tracks import TrackRecord
from baselines.rules.decider import Decider
from baselines.rules.metrics import StatementMetrics, measure_statements
from baselines.rules.statements import record_statements
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.quickest_world import QuickestWorld
from hybrid_env.registration import make_vector_env
from hybrid_env.rendering.history import ACTIVE, TRACE_INDEX

FloatArray = NDArray[np.float64]


def record_episode(name: str, decider: Decider, env_id: str, seed: int, **options: Any) -> TrackRecord:
    """Run a decider on one episode of announced segments and note every tick.

    Args:
        name: of the decider.
        decider: the decider.
        env_id: registered id of the environment.
        seed: of the episode.
        options: keyword arguments of the environment.
    """
    longest = make_vector_env(env_id, 1, **options).options.longest_segment
    env = make_vector_env(env_id, 1, tick_info=False, trace_rows=2 * longest, **options)
    observation, _ = env.reset(seed=seed)
    traces = [env.world.read_trace(0)]
    state: Any = None
    start = np.ones(1, np.bool_)
    decided: list[dict[str, Any]] = []
    rewards = 0.0
    while not (start[0] and decided):
        actions, state = decider.predict(observation, state=state, episode_start=start, deterministic=True)
        observation, reward, start, _, info = env.step(np.asarray(actions))
        traces.append(env.world.read_trace(0))
        rewards += float(reward[0])
        if "decided_mode" in info:
            decided.append({key: values[0] for key, values in info.items() if not key.startswith("_")})
    trace = np.concatenate(traces)
    lengths, ticks, true_modes, correct = (
        np.array([one[key] for one in decided])
        for key in ("decided_length", "ticks", "decided_true_mode", "correct")
    )
    switches = np.cumsum(lengths) - lengths
    since = np.arange(len(trace)) - np.repeat(switches, lengths)
    return TrackRecord(
        name=name,
        truth=trace[:, [TRACE_INDEX["x"], TRACE_INDEX["y"]]],
        measurements=trace[:, [TRACE_INDEX["measured_x"], TRACE_INDEX["measured_y"]]],
        true_modes=np.repeat(true_modes, lengths),
        modes=np.where(since < np.repeat(ticks, lengths), UNDECIDED, trace[:, ACTIVE].astype(np.int64)),
        right=np.repeat(correct, lengths),
        marks=switches + ticks - 1,
        switches=switches,
        estimates=trace[:, [TRACE_INDEX["estimate_x"], TRACE_INDEX["estimate_y"]]],
        summary=f"{rewards / len(decided):+.2f}",
    )


class _Witness:
    """A decider that notes the object and its measurements, and decides as another one."""

    def __init__(self, decider: Any):
        self.decider, self.predict = decider, decider.predict
        self.truth: list[FloatArray] = []
        self.measurements: list[FloatArray] = []

    def observe(self, world: QuickestWorld) -> NDArray[Any]:
        self.truth.append(world.field("truth")[0, [0, 2]])
        self.measurements.append(world.field("measurement")[0].copy())
        observe = getattr(self.decider, "observe", None)
        observed: NDArray[Any] = world.observations if observe is None else observe(world)
        return observed


def record_track(name: str, decider: Any, options: QuickestOptions, seed: int) -> TrackRecord:
    """Run a decider on one track with unknown switch moments and note every tick.

    Args:
        name: of the decider.
        decider: as in `record_statements`.
        options: of the environment.
        seed: of the track.
    """
    witness: Any = _Witness(decider)
    statements = record_statements(witness, 1, seed, **vars(options))
    true, stated = (modes[:, 0] for modes in statements)
    return TrackRecord(
        name=name,
        truth=np.array(witness.truth),
        measurements=np.array(witness.measurements),
        true_modes=true,
        modes=stated,
        right=true == stated,
        marks=np.flatnonzero(np.diff(stated, prepend=stated[:1])),
        switches=np.zeros(0, np.int64),
        estimates=None,
        summary=_summary(measure_statements(statements, options.change_cost), len(true)),
    )


def _summary(metrics: StatementMetrics, ticks: int) -> str:
    right, reward = f"{100 * metrics.right[0]:.1f} %", f"{metrics.reward[0]:.3f}"
    delay = f"mean delay {metrics.mean_delay:.1f} ticks" if metrics.delays.size else "no switch detected"
    wrong = round(1e-3 * ticks * float(metrics.wrong_changes[0]))
    return f"{right} of the ticks right, {delay}, {wrong} changes to a wrong mode, mean reward {reward}"
