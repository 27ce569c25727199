"""Labels beside the curves of a figure, in place of a legend."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy import ndimage

CELL = 2.0  # resolution of the search [px]
LABEL_GAP = 4.0  # free space around a label [px]
LEADER_DISTANCE = 12.0  # a label farther from its curve than this [px] is joined to it by a line
FONT_SIZE = 9.0  # [pt]
DARKENING = 0.65  # factor on the colour of a curve for readable text
BAND_COST = 12.0  # cost of a label inside a filled area, in pixels of distance
END_COST = 0.05  # cost of a pixel between a label and the end of its curve

NOTHING = ("None", "none", "", " ", None)  # styles of a line or marker that is not drawn
Mask = NDArray[np.bool_]


def label_curves(axes: Any, curves: Sequence[tuple[Any, str]], *, fixed: bool = False) -> list[Any]:
    """Write the name of each curve, a `Line2D` of these axes, beside it in its colour; return the annotations.

    Labels overlap neither curves nor markers nor each other, as long as there is free space. One that does not fit
    beside its curve is joined to it by a thin line. Call this last: limits and layout must not change afterwards.
    `fixed`: the figure has been drawn since they last did.
    """
    if not fixed:
        axes.figure.draw_without_rendering()
    box = axes.get_window_extent()
    shape = int(box.height / CELL), int(box.width / CELL)
    masks = {line: _line_mask(line, box, shape) for line in axes.lines if line.get_visible()}
    occupied = np.logical_or.reduce([*masks.values(), np.zeros(shape, np.bool_)])
    bands = _band_mask(axes, box, shape)
    annotations = []
    for line, text in curves:
        others = [masks[other] for other, _ in curves if other is not line]
        annotation = axes.annotate(
            text, (0, 0), xycoords=axes.transAxes, fontsize=FONT_SIZE, ha="left", va="bottom", zorder=6,
            color=DARKENING * np.array(to_rgb(line.get_color())), annotation_clip=False,
            path_effects=[withStroke(linewidth=2.5, foreground="white")], parse_math=False,
        )  # fmt: skip
        annotation.set_in_layout(False)
        extent = annotation.get_window_extent()
        size = tuple(int(np.ceil(length / CELL)) for length in (extent.height, extent.width))
        row, column = _best_place(masks[line], others, occupied, bands, size)
        near = _nearest(masks[line], row, column, size)
        place = CELL * column / box.width, CELL * row / box.height
        annotation.set_position(place)
        annotation.xyann = place
        if np.hypot(*(near[1] - near[0])) * CELL > LEADER_DISTANCE:
            ends = np.array([(x * CELL / box.width, y * CELL / box.height) for y, x in near])
            axes.plot(*ends.T, color=line.get_color(), linewidth=0.7, transform=axes.transAxes, zorder=1)
            steps = np.linspace(near[0], near[1], 200).astype(int)
            occupied[tuple(np.clip(steps, 0, np.array(shape) - 1).T)] = True
        occupied[row : row + size[0], column : column + size[1]] = True
        annotations.append(annotation)
    return annotations


def label_lines(axes: Any) -> None:
    """Write the label of each line that has one beside it; call this last, see `label_curves`."""
    label_curves(axes, [(line, line.get_label()) for line in axes.lines if not line.get_label().startswith("_")])


def _line_mask(line: Any, box: Any, shape: tuple[int, int]) -> Mask:
    """The cells that a line and its markers cover; those at the edge for a line outside the axes."""
    mask = np.zeros(shape, np.bool_)
    points = line.get_transform().transform(line.get_xydata())
    points = (points[np.isfinite(points).all(1)] - (box.x0, box.y0)) / CELL
    if not len(points):
        return mask
    steps = [points]
    if line.get_linestyle() not in NOTHING:
        for start, end in pairwise(points):
            steps.append(np.linspace(start, end, int(min(np.abs(end - start).max() + 2, 4000))))
    cells = np.concatenate(steps)[:, ::-1].astype(int)
    inside = ((cells >= 0) & (cells < shape)).all(1)
    cells = cells[inside] if inside.any() else np.clip(cells, 0, np.array(shape) - 1)
    mask[tuple(cells.T)] = True
    if line.get_marker() not in NOTHING:
        radius = round(line.get_markersize() * (line.figure.dpi / 72.0 / CELL) / 2.0)
        marked, cells = np.zeros(shape, np.bool_), points[:, ::-1].astype(int)
        marked[tuple(cells[((cells >= 0) & (cells < shape)).all(1)].T)] = True
        mask |= ndimage.maximum_filter(marked, size=2 * radius + 1)
    return mask


def _band_mask(axes: Any, box: Any, shape: tuple[int, int]) -> Mask:
    """The cells inside the filled areas of the axes."""
    rows, columns = np.indices(shape)
    centres = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], 1) * CELL + (box.x0, box.y0)
    mask = np.zeros(len(centres), np.bool_)
    for collection in axes.collections:
        for path in collection.get_paths():
            mask |= collection.get_transform().transform_path(path).contains_points(centres)
    return mask.reshape(shape)


def _best_place(
    own: Mask, others: Sequence[Mask], occupied: Mask, bands: Mask, size: tuple[int, ...]
) -> tuple[int, int]:
    """Lower left cell of the cheapest place of a label."""
    gap = round(LABEL_GAP / CELL)
    height, width = min(size[0], own.shape[0] - 2), min(size[1], own.shape[1] - 2)
    origin = -(height // 2), -(width // 2)  # windows begin at the lower left cell, not at their centre
    window = {"size": (height, width), "origin": origin}
    padded = {"size": (height + 2 * gap, width + 2 * gap), "origin": origin}
    distance = CELL * ndimage.minimum_filter(ndimage.distance_transform_edt(~own), **window)
    cost = distance + BAND_COST * ndimage.uniform_filter(bands.astype(float), **window)
    foreign = np.logical_or.reduce([*others, np.zeros_like(own)])
    if foreign.any():
        away = CELL * ndimage.minimum_filter(ndimage.distance_transform_edt(~foreign), **window)
        cost += 2.0 * np.maximum(0.0, distance + 4.0 - away)
    cells = np.argwhere(own)
    end = cells[cells[:, 1].argmax()]
    rows, columns = np.indices(own.shape)
    cost += END_COST * CELL * np.hypot(rows + height / 2 - end[0], columns + width / 2 - end[1])
    cost += 1e3 * ndimage.uniform_filter(occupied.astype(float), **padded)
    cost += 1e4 * ndimage.maximum_filter(occupied, **padded)
    fits = cost[1 : own.shape[0] - height, 1 : own.shape[1] - width]
    row, column = np.unravel_index(int(fits.argmin()), fits.shape)
    return int(row) + 1, int(column) + 1


def _nearest(own: Mask, row: int, column: int, size: tuple[int, ...]) -> NDArray[np.float64]:
    """(2, 2) row and column of the nearest points of a curve and of a label."""
    cells = np.argwhere(own).astype(float)
    low = np.array([row, column], float)
    inside = np.clip(cells, low, low + np.array(size))
    index = int(np.hypot(*(cells - inside).T).argmin())
    return np.array([cells[index], inside[index]])
