import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.interface.recording_files import read_recording, write_table
from agents.recordings.command import Track, estimate_noise
from agents.recordings.figure import draw_track
from baselines.recordings import ate
from hybrid_env import HybridTrackVectorEnv
from hybrid_env.checks import ArgumentError
from hybrid_env.core.records import TRACE_COLUMNS


def simulate(scheme: str, rows: int, seed: int = 1, **options: Any) -> NDArray[np.float64]:
    """Measured and true positions, (T, 4)."""
    env = HybridTrackVectorEnv(1, trace_rows=rows, scheme=scheme, initial_error=0, **options)
    env.reset(seed=seed)
    traces, terminated = [env.world.traced(0)], False
    while not terminated:
        terminated = bool(env.step(np.zeros(1, np.int64))[2][0])
        traces.append(env.world.traced(0))
    columns = [TRACE_COLUMNS.index(name) for name in ("measured_x", "measured_y", "x", "y")]
    return np.concatenate(traces)[:, columns]


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """Straight, left, straight, 60 ticks each."""
    path = tmp_path / "flight.csv"
    positions = simulate("S60 L60r5 S60", 60, measurement_variance=0.01)
    write_table(path, {"t": 0.1 * np.arange(180), "x": positions[:, 0], "y": positions[:, 1]})
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_modes_of_a_simulated_flight_are_found(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Track(flight, piece=60).run()

    pieces = rows_of(flight.parent / "flight_track" / "modes.csv")
    assert [row["mode"] for row in pieces] == ["S", "L r=5 m", "S"]
    assert [row["mode_index"] for row in pieces] == ["0", "1", "0"]
    assert [row["radius"] for row in pieces] == ["", "5.0", ""]
    assert [(row["first_tick"], row["last_tick"]) for row in pieces] == [
        ("1", "60"), ("61", "120"), ("121", "180")
    ]  # fmt: skip
    for row in pieces:
        assert int(row["first_tick"]) <= int(row["decision_tick"]) <= int(row["last_tick"])
        assert row["undecided"] == "False"
    printed = capsys.readouterr().out
    assert "estimated from third differences" in printed
    assert "L r=5 m" in printed
    assert "track.png" in printed


def test_the_estimates_follow_the_object_and_keep_the_measurements(flight: Path) -> None:
    Track(flight, piece=60).run()

    path = flight.parent / "flight_track" / "estimates.csv"
    again, recording = read_recording(path), read_recording(flight)
    np.testing.assert_array_equal(again.measurements, recording.measurements)
    np.testing.assert_array_equal(again.times, recording.times)
    rows = rows_of(path)
    estimates = np.array([[float(row["estimate_x"]), float(row["estimate_y"])] for row in rows])
    truth = simulate("S60 L60r5 S60", 60, measurement_variance=0.01)[:, 2:]
    errors = [np.hypot(*(found - truth).T).mean() for found in (estimates, recording.measurements)]
    assert errors[0] < 0.8 * errors[1]
    assert {(row["mode"], row["mode_index"]) for row in rows} == {("S", "0"), ("L r=5 m", "1")}
    assert (path.parent / "track.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(entry.name for entry in path.parent.iterdir()) == [
        "estimates.csv",
        "modes.csv",
        "track.png",
    ]


def test_the_command_decides_as_the_algorithm_does(flight: Path, tmp_path: Path) -> None:
    start = (0.0, 1.0, 0.0, 1.0)
    Track(
        flight, lengths=(50, 100, 30), radii=(3.0, 5.0), measurement_variance=0.2, process_variance=0.0,
        alpha=1e-9, beta=1e-2, undecided="keep", start=start, out=tmp_path / "deep" / "er",
    ).run()  # fmt: skip

    expected = ate.track(
        read_recording(flight).measurements, (50, 100, 30), start, radii=(3.0, 5.0), measurement_variance=0.2,
        process_variance=0.0, alpha=1e-9, beta=1e-2, undecided="keep",
    )  # fmt: skip
    pieces = rows_of(tmp_path / "deep" / "er" / "modes.csv")
    assert [int(row["mode_index"]) for row in pieces] == expected.decided.tolist()
    ticks = [
        "" if open_ else str(first + tick)
        for first, tick, open_ in zip((0, 50, 150), expected.ticks, expected.undecided, strict=True)
    ]
    assert [row["decision_tick"] for row in pieces] == ticks


def test_without_lengths_a_switch_is_possible_every_fifty_ticks(flight: Path) -> None:
    Track(flight).run()
    pieces = rows_of(flight.parent / "flight_track" / "modes.csv")
    assert [row["last_tick"] for row in pieces] == ["50", "100", "150", "180"]


def test_many_pieces_are_printed_in_part(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Track(flight, piece=6).run()
    assert "... and 10 more in modes.csv" in capsys.readouterr().out


@pytest.mark.parametrize("rows", [1, 2])
def test_a_recording_of_a_tick_or_two_is_left_undecided(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "short.csv"
    write_table(path, {"x": [0.0] * rows, "y": [0.0] * rows})
    Track(path, measurement_variance=0.1).run()
    [piece] = rows_of(tmp_path / "short_track" / "modes.csv")
    assert (piece["decision_tick"], piece["undecided"]) == ("", "True")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"piece": 60, "lengths": (180,)}, "piece=60.*where lengths are given"),
        ({"piece": 0}, "piece=0.*integer >= 1"),
        ({"lengths": (60, 60)}, "lengths=.60, 60..*add up to the 180 rows.*not 120"),
        ({"lengths": (200, -20)}, "lengths=-20.*integer >= 1"),
        ({"radii": ()}, "radii=.*distinct finite radii > 0"),
        ({"radii": (5.0, 5.0)}, "radii=.*distinct finite radii > 0"),
        ({"tau": 0.0}, "tau=0.0.*between 1e-09 and 1e.09"),
        ({"tau": 0.1002}, "tau=0.1002.*0.1 as in the t column"),
        ({"process_variance": -1.0}, "process_variance=-1.0.*>= 0"),
        ({"measurement_variance": 0.0}, "measurement_variance=0.0.*> 0"),
        ({"alpha": 0.0}, "alpha=0.0.*between 0 and 1"),
        ({"beta": float("nan")}, "beta=nan.*between 0 and 1"),
        ({"undecided": "guess"}, "undecided='guess'.*'keep', 'likeliest'"),
        ({"start": (0.0, 0.0, 0.0, float("inf"))}, "start.3.=inf.*finite"),
        ({"start": (0.0, 1e200, 0.0, 1e200)}, "leave all bounds"),
        ({"out": "flight.csv"}, "out=.*folder that can be written to"),
        ({"out": "flight.csv/below"}, "out=.*folder that can be written to"),
        ({"file": "missing.csv"}, "missing.csv.*exists"),
    ],
)
def test_a_bad_argument_is_refused_in_one_line_before_anything_is_written(
    flight: Path, arguments: dict[str, Any], message: str
) -> None:
    paths = {name: flight.parent / value for name, value in arguments.items() if name in ("file", "out")}
    with pytest.raises(ArgumentError, match=message) as caught:
        Track(**({"file": flight} | arguments | paths)).run()
    assert "\n" not in str(caught.value)
    assert list(flight.parent.iterdir()) == [flight]


def test_a_tick_within_a_thousandth_of_the_times_is_taken(flight: Path) -> None:
    Track(flight, tau=0.10009, piece=60).run()


def test_noise_is_estimated_within_a_few_per_cent() -> None:
    for variance in (0.001, 0.1):
        measurements = simulate("random 200x50-100", 100, measurement_variance=variance)[:, :2]
        assert estimate_noise(measurements) == pytest.approx(variance, rel=0.05)
        outliers = measurements.copy()
        outliers[::100] += 1e3
        assert estimate_noise(outliers) == pytest.approx(variance, rel=0.15)


def test_noise_that_cannot_be_estimated_is_asked_for() -> None:
    with pytest.raises(ArgumentError, match=r"measurement_variance=None.*needs 50 rows, not 49"):
        estimate_noise(np.zeros((49, 2)))
    line = 0.1 * np.arange(100.0)
    with pytest.raises(ArgumentError, match=r"measurement_variance=None.*shows no noise"):
        estimate_noise(np.stack([line, line + 5e6], axis=1))


def test_the_figure_names_every_mode_and_mark_once(flight: Path) -> None:
    recording = read_recording(flight)
    tracks = ate.track(recording.measurements, [90, 90], alpha=1e-300)
    assert recording.times is not None
    figure = draw_track(recording.times, recording.measurements, [90, 90], tracks, (5.0,))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(labels) == len(set(labels))
    assert {"measured", "first tick", "S", "no decision"} <= set(labels)
    assert figure.axes[0].get_aspect() == 1.0
