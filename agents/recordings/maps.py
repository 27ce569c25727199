"""A tracked recording on a map: as GeoJSON, as GPX, and interactive in one HTML file."""

import math
from typing import Any

import gpxpy.gpx
import numpy as np
import pandas as pd

from agents.figures.canvas import GREY
from agents.recordings.figure import mode_colours, mode_lines, thinned
from agents.recordings.tracked_recording import TrackedRecording
from baselines.recordings.recording import iso_texts
from hybrid_env.checks import AnyArray, FloatArray
from hybrid_env.extras import explained


def geojson(tracked: TrackedRecording) -> dict[str, Any]:
    """Return a feature collection (RFC 7946) with the estimated line of each piece; its properties
    are columns of modes.csv. Longitudes go on beyond 180 degrees, so that no line goes around the
    world.
    """
    table = pd.DataFrame(tracked.piece_table())
    shown = table.filter(regex="^(object|piece|mode|radius|(begin|end)(_time)?)$")
    features = []
    lines = mode_lines(tracked, len(tracked.modes))
    for (_, rows), properties in zip(lines, shown.to_dict("records"), strict=True):
        # A line has two points at least.
        places = _degrees(tracked, tracked.estimates[np.resize(rows, max(len(rows), 2)), ::2])
        properties["radius"] = properties["radius"] or None
        features.append(
            {
                "type": "Feature",
                "geometry": {"type": "LineString", "coordinates": places.round(9).tolist()},
                "properties": properties,
            }
        )
    return {"type": "FeatureCollection", "features": features}


def gpx_text(tracked: TrackedRecording) -> str:
    """Return a GPX file with the estimates as a track, and a segment for each piece, whose first
    point has the name of the mode. Its points have times if the recording has an epoch.
    """
    projection, dates = tracked.recording.projection, tracked.recording.dates
    assert projection is not None
    places = projection.inverse(*tracked.estimates[:, ::2].T).round(9)
    instants: list[Any] = [None] * len(places)
    if dates is not None:
        instants = pd.DatetimeIndex(dates, tz="UTC").to_pydatetime().tolist()
    names = tracked.mode_names()
    track = gpxpy.gpx.GPXTrack(tracked.recording.name)
    for first, end, mode, _ in tracked.pieces.tolist():
        points = [
            gpxpy.gpx.GPXTrackPoint(latitude, longitude, time=instant)
            for (latitude, longitude), instant in zip(
                places[first:end].tolist(), instants[first:end], strict=True
            )
        ]
        points[0].name = names[mode]
        track.segments.append(gpxpy.gpx.GPXTrackSegment(points))
    file = gpxpy.gpx.GPX()
    file.creator = "hybridtrack"
    file.tracks.append(track)
    return file.to_xml()


def check_plotly() -> Any:
    """Return the package plotly."""
    with explained():
        import plotly.subplots
    return plotly


def map_figure(tracked: TrackedRecording) -> Any:
    """Return a figure of plotly: the measured and the estimated track, with a projection on a map
    of OpenStreetMap, and below it the probabilities over time. Time, mode and probability appear
    under the pointer. Only the map needs a network.
    """
    recording = tracked.recording
    projected = recording.projection is not None
    plotly = check_plotly()
    figure = plotly.subplots.make_subplots(
        rows=2,
        cols=1,
        row_heights=(0.78, 0.22),
        vertical_spacing=0.08,
        specs=[[{"type": "map" if projected else "xy"}], [{"type": "xy"}]],
    )
    _add_track(figure, tracked)
    _add_probabilities(figure, tracked)
    title = f"{recording.name}: decided by {tracked.decider}"
    if projected:
        words = "The map is loaded from openstreetmap.org: it is white without a network."
        title += f"<br><sub>{words}</sub>"
    figure.update_layout(
        title=title,
        template="plotly_white",
        hovermode="closest",
        margin={"l": 60, "r": 20, "t": 60, "b": 50},
    )
    if projected:
        figure.update_maps(style="open-street-map", **_view(tracked))
    else:
        figure.update_xaxes(title=f"x [{recording.unit}]", row=1)
        figure.update_yaxes(title=f"y [{recording.unit}]", row=1, scaleanchor="x", scaleratio=1)
    dated = recording.dates is not None
    figure.update_xaxes(title="time (UTC)" if dated else f"t [{recording.time_unit}]", row=2)
    figure.update_yaxes(title="probability", range=(0.0, 1.0), row=2)
    return figure


def _add_track(figure: Any, tracked: TrackedRecording) -> None:
    recording = tracked.recording
    clock = _clock(tracked)
    at = {"row": 1, "col": 1}
    add = figure.add_scattergl if recording.projection is None else figure.add_scattermap
    # More rows would delay a browser.
    most = 100_000
    rows = thinned(np.flatnonzero(recording.measured), most)
    add(
        **_places(tracked, recording.positions[rows]),
        mode="markers",
        name="measurements",
        marker={"color": GREY, "size": 4, "opacity": 0.5},
        text=clock[rows],
        hovertemplate="%{text}<extra>measured</extra>",
        **at,
    )
    lines = mode_lines(tracked, most)
    for mode, (name, colour) in enumerate(
        zip(tracked.mode_names(), mode_colours(tracked), strict=True)
    ):
        # -1 interrupts the line.
        of_mode = [np.append(rows, -1) for line_mode, rows in lines if line_mode == mode]
        joined = np.concatenate([np.zeros(0, int), *of_mode])
        positions = np.where(joined[:, None] < 0, np.nan, tracked.estimates[joined, ::2])
        add(
            **_places(tracked, positions),
            mode="lines",
            name=name,
            legendgroup=name,
            line={"color": colour, "width": 4},
            text=clock[joined],
            customdata=tracked.probabilities[joined, mode],
            hovertemplate=f"%{{text}}<br>p = %{{customdata:.2f}}<extra>{name}</extra>",
            **at,
        )


def _add_probabilities(figure: Any, tracked: TrackedRecording) -> None:
    """Add the probabilities as stacked areas, which end at gaps."""
    dates = tracked.recording.dates
    times = tracked.recording.times if dates is None else dates
    every = -(-len(times) // 5000)
    parts = [
        np.append(np.arange(piece.first, piece.end - 1, every), piece.end - 1)
        for piece in tracked.grid.pieces
        if piece.first < piece.end
    ]
    rows = np.concatenate([np.pad(part, 1, "edge") for part in parts])
    within = np.concatenate([np.pad(np.ones(len(part)), 1) for part in parts])
    for mode, (name, colour) in enumerate(
        zip(tracked.mode_names(), mode_colours(tracked), strict=True)
    ):
        figure.add_scatter(
            x=times[rows],
            y=within * tracked.probabilities[rows, mode],
            name=name,
            legendgroup=name,
            showlegend=False,
            stackgroup="probabilities",
            line={"color": colour, "width": 0},
            hovertemplate=f"%{{x}}<br>p = %{{y:.2f}}<extra>{name}</extra>",
            row=2,
            col=1,
        )


def _clock(tracked: TrackedRecording) -> AnyArray:
    """Return the times of the rows as texts, dates if there is an epoch."""
    recording = tracked.recording
    if recording.dates is not None:
        return iso_texts(recording.dates)
    return np.array([f"t = {time:.6g} {recording.time_unit}" for time in recording.times.tolist()])


def _places(tracked: TrackedRecording, positions: FloatArray) -> dict[str, FloatArray]:
    """Return the coordinates of positions (n, 2) for a map, or for a plane."""
    if tracked.recording.projection is None:
        return dict(zip("xy", positions.T, strict=True))
    return dict(zip(("lon", "lat"), _degrees(tracked, positions).T, strict=True))


def _degrees(tracked: TrackedRecording, positions: FloatArray) -> FloatArray:
    """Return longitudes and latitudes (n, 2) of positions, within 180 degrees of the centre."""
    projection = tracked.recording.projection
    assert projection is not None
    latitudes, longitudes = projection.inverse(*positions.T).T
    east = (longitudes - projection.longitude + 180.0) % 360.0 - 180.0
    return np.stack([projection.longitude + east, latitudes], axis=1)


def _view(tracked: TrackedRecording) -> dict[str, Any]:
    """Return centre and zoom of a map that shows the measurements."""
    recording = tracked.recording
    projection = recording.projection
    assert projection is not None
    extent = np.ptp(recording.positions[recording.measured], axis=0)
    # At the zoom 0 the equator has 512 pixels; a usual window has 800 x 400.
    equator = 40_075_000.0 * math.cos(math.radians(projection.latitude))
    metres = max(float((extent / (800.0, 400.0)).max()), 0.01)
    zoom = math.log2(equator / 512.0 / metres)
    return {"center": {"lat": projection.latitude, "lon": projection.longitude}, "zoom": zoom}
