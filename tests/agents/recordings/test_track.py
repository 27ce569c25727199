import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agents.interface.recording_files import read_recording, write_table
from numpy.typing import NDArray

from agents.recordings.command import Track, estimate_noise
from agents.recordings.figure import draw_track
from baselines.recordings import ate
from hybrid_env import HybridTrackVectorEnv
from hybrid_env.checks import ArgumentError
from hybrid_env.core.records import TRACE_COLUMNS


def simulate(scheme: str, rows: int, seed: int = 1, **options: Any) -> NDArray[np.float64]:
    """(T, 4) measured and true positions [m]."""
    env = HybridTrackVectorEnv(1, trace_rows=rows, scheme=scheme, initial_error=0, **options)
    env.reset(seed=seed)
    traces, terminated = [env.world.read_trace(0)], False
    while not terminated:
        terminated = bool(env.step(np.zeros(1, np.int64))[2][0])
        traces.append(env.world.read_trace(0))
    columns = [TRACE_COLUMNS.index(name) for name in ("measured_x", "measured_y", "x", "y")]
    return np.concatenate(traces)[:, columns]


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """Recording of a straight piece, a left turn and a straight piece of 60 ticks each."""
    path = tmp_path / "flight.csv"
    positions = simulate("S60 L60r5 S60", 60, measurement_variance=0.01)
    write_table(path, {"t": 0.1 * np.arange(180), "x": positions[:, 0], "y": positions[:, 1]})
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_decided_modes_of_a_simulated_flight_are_correct(
    flight: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
    assert "estimated, relative standard error 18%" in printed
    assert "L r=5 m" in printed
    assert "track.png" in printed


def test_estimates_are_closer_to_the_truth_than_measurements(flight: Path) -> None:
    Track(flight, piece=60).run()

    path = flight.parent / "flight_track" / "estimates.csv"
    written, recording = read_recording(path), read_recording(flight)
    np.testing.assert_array_equal(written.measurements, recording.measurements)
    np.testing.assert_array_equal(written.times, recording.times)
    rows = rows_of(path)
    estimates = np.array([[float(row["estimate_x"]), float(row["estimate_y"])] for row in rows])
    truth = simulate("S60 L60r5 S60", 60, measurement_variance=0.01)[:, 2:]
    errors = [np.hypot(*(positions - truth).T).mean() for positions in (estimates, recording.measurements)]
    assert errors[0] < 0.8 * errors[1]
    assert {(row["mode"], row["mode_index"]) for row in rows} == {("S", "0"), ("L r=5 m", "1")}
    assert (path.parent / "track.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(entry.name for entry in path.parent.iterdir()) == [
        "estimates.csv",
        "modes.csv",
        "track.png",
    ]


def test_command_decides_as_ate_track(flight: Path, tmp_path: Path) -> None:
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
        "" if undecided else str(first + tick)
        for first, tick, undecided in zip((0, 50, 150), expected.ticks, expected.undecided, strict=True)
    ]
    assert [row["decision_tick"] for row in pieces] == ticks


def test_default_pieces_have_50_ticks(flight: Path) -> None:
    Track(flight).run()
    pieces = rows_of(flight.parent / "flight_track" / "modes.csv")
    assert [row["last_tick"] for row in pieces] == ["50", "100", "150", "180"]


def test_only_20_pieces_are_printed(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Track(flight, piece=6).run()
    assert "... and 10 more in modes.csv" in capsys.readouterr().out


@pytest.mark.parametrize("rows", [1, 2])
def test_recording_of_one_or_two_ticks_is_undecided(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "short.csv"
    write_table(path, {"x": [0.0] * rows, "y": [0.0] * rows})
    Track(path, measurement_variance=0.1).run()
    [piece] = rows_of(tmp_path / "short_track" / "modes.csv")
    assert (piece["decision_tick"], piece["undecided"]) == ("", "True")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"piece": 60, "lengths": (180,)}, "piece=60.*no value if lengths are given"),
        ({"piece": 0}, "piece=0.*integer >= 1"),
        ({"lengths": (60, 60)}, "lengths=.60, 60..*sum is 180.*not 120"),
        ({"lengths": (200, -20)}, "lengths=-20.*integer >= 1"),
        ({"radii": ()}, "radii=.*distinct numbers from 1e-12"),
        ({"radii": (5.0, 5.0)}, "radii=.*distinct numbers from 1e-12"),
        ({"tau": 0.0}, "tau=0.0.*between 1e-09 and 1e.09"),
        ({"tau": 0.1002}, "tau=0.1002.*0.1 as in the t column"),
        ({"process_variance": -1.0}, "process_variance=-1.0.*>= 0"),
        ({"measurement_variance": 0.0}, "measurement_variance=0.0.*> 0"),
        ({"alpha": 0.0}, "alpha=0.0.*between 0 and 1"),
        ({"beta": float("nan")}, "beta=nan.*between 0 and 1"),
        ({"undecided": "guess"}, "undecided='guess'.*'keep', 'likeliest'"),
        ({"start": (0.0, 0.0, 0.0, float("inf"))}, "start.3.=inf.*finite"),
        ({"start": (0.0, 1e200, 0.0, 1e200)}, "start.1.=1e.200.*up to 1e.30"),
        ({"out": "flight.csv"}, "out=.*writable folder"),
        ({"out": "flight.csv/below"}, "out=.*writable folder"),
        ({"file": "missing.csv"}, "missing.csv.*existing CSV file"),
    ],
)
def test_invalid_argument_raises_before_any_file_is_written(
    flight: Path, arguments: dict[str, Any], message: str
) -> None:
    paths = {name: flight.parent / value for name, value in arguments.items() if name in ("file", "out")}
    with pytest.raises(ArgumentError, match=message) as caught:
        Track(**({"file": flight} | arguments | paths)).run()
    assert "\n" not in str(caught.value)
    assert list(flight.parent.iterdir()) == [flight]


def test_tau_may_differ_from_times_by_a_thousandth(flight: Path) -> None:
    Track(flight, tau=0.10009, piece=60).run()


def test_noise_estimate_is_accurate_and_robust_against_outliers() -> None:
    for variance in (0.001, 0.1):
        measurements = simulate("random 200x50-100", 100, measurement_variance=variance)[:, :2]
        assert estimate_noise(measurements) == pytest.approx(variance, rel=0.05)
        outliers = measurements.copy()
        outliers[::100] += 1e3
        assert estimate_noise(outliers) == pytest.approx(variance, rel=0.15)


def test_noise_estimate_needs_enough_rows_and_noise() -> None:
    with pytest.raises(ArgumentError, match=r"measurement_variance=None.*needs 50 rows, not 49"):
        estimate_noise(np.zeros((49, 2)))
    line = 0.1 * np.arange(100.0)
    with pytest.raises(ArgumentError, match=r"measurement_variance=None.*shows no noise"):
        estimate_noise(np.stack([line, line + 5e6], axis=1))


def test_legend_names_every_mode_and_marker_once(flight: Path) -> None:
    recording = read_recording(flight)
    tracks = ate.track(recording.measurements, [90, 90], alpha=1e-300)
    assert recording.times is not None
    figure = draw_track(recording.times, recording.measurements, [90, 90], tracks, (5.0,))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(labels) == len(set(labels))
    assert {"measurements", "first tick", "S", "no decision", "possible switch"} <= set(labels)
    assert figure.axes[0].get_aspect() == 1.0


def test_decisions_are_marked_and_numbered_on_the_trajectory(flight: Path) -> None:
    recording = read_recording(flight)
    lengths = [60, 60, 60]
    tracks = ate.track(recording.measurements, lengths, measurement_variance=0.01)
    assert not tracks.undecided.any()
    assert recording.times is not None
    axes = draw_track(recording.times, recording.measurements, lengths, tracks, (5.0,)).axes[0]
    [marks] = [line for line in axes.lines if line.get_label() == "decision"]
    rows = np.array([0, 60, 120]) + tracks.ticks - 1
    np.testing.assert_array_equal(marks.get_xydata(), tracks.estimates[rows][:, [0, 2]])
    assert [text.get_text() for text in axes.texts] == ["1", "2", "3"]


def test_long_recording_is_drawn_without_numbers() -> None:
    measurements = simulate("random 100x50-100", 100)[:, :2]
    lengths = [60] * (len(measurements) // 60)
    tracks = ate.track(measurements[: sum(lengths)], lengths)
    times = 0.1 * np.arange(sum(lengths))
    figure = draw_track(times, measurements[: sum(lengths)], lengths, tracks, (5.0,))
    assert len(lengths) > 100
    assert not figure.axes[0].texts
    figure.draw_without_rendering()
