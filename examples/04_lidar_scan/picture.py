"""Draws a laser scan from above, a point cloud in perspective, and the distances of the cloud as an image."""

import cv2
import numpy as np
from numpy.typing import NDArray

from mjplug_schemas.sensor_msgs import LaserScan, PointCloud2

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

PAPER, GRID, INK, FREE, BEAM = (28, 22, 18), (58, 48, 42), (225, 220, 215), (66, 52, 40), (90, 200, 255)
"""Colours as blue, green, red (BGR), from 0 to 255."""

WIDE, HIGH, STRIP, MARGIN = 700, 620, 150, 24
"""Width and height of a panel, height of the strip of distances, width of the margin [pixels]."""


def picture(scan: LaserScan, cloud: PointCloud2) -> Image:
    """Returns the picture: BGR, shape (height, width, 3)."""
    points = np.frombuffer(cloud.data, "<f4").reshape(cloud.height, cloud.width, 3).astype(float)
    top = np.hstack([_from_above(scan), _in_perspective(points.reshape(-1, 3))])
    return np.vstack([top, _distances(points, top.shape[1])])


def _panel(width: int, height: int, title: str) -> Image:
    panel = np.full((height, width, 3), PAPER, np.uint8)
    _write(panel, title, (MARGIN, 34), 0.62)
    return panel


def _write(image: Image, text: str, at: tuple[int, int], size: float = 0.42) -> None:
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)


def _colours(values: Array, low: float, high: float) -> Image:
    """Returns a colour for each value, shape (n, 3)."""
    scaled = ((values - low) / (high - low)).clip(0, 1) * 215 + 25
    return cv2.applyColorMap(scaled.astype(np.uint8).reshape(-1, 1), cv2.COLORMAP_TURBO).reshape(-1, 3)


def _from_above(scan: LaserScan) -> Image:
    image = _panel(WIDE, HIGH, f"/scan   LaserScan, {len(scan.ranges)} ranges")
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    ranges = np.array(scan.ranges)
    seen = np.isfinite(ranges)
    ends = np.where(seen, ranges, scan.range_max)
    # The x axis of the sensor points up in the picture, the y axis to the left.
    scale, origin = 70.0, np.array([WIDE / 2, HIGH * 0.66])
    pixels = origin + scale * np.stack([-np.sin(angles) * ends, -np.cos(angles) * ends], axis=1)
    cv2.fillPoly(image, [np.vstack([origin, pixels]).astype(np.int32)], FREE, cv2.LINE_AA)
    centre = tuple(origin.astype(int))
    for metre in range(1, 6):
        cv2.circle(image, centre, round(scale * metre), GRID, 1, cv2.LINE_AA)
        _write(image, f"{metre} m", (centre[0] + 6, centre[1] - round(scale * metre) + 14), 0.36)
    for (x, y), colour in zip(pixels[seen], _colours(ranges[seen], 0.3, 5.0), strict=True):
        cv2.circle(image, (round(x), round(y)), 2, colour.tolist(), -1, cv2.LINE_AA)
    arrow = np.array([[0, -13], [9, 10], [0, 5], [-9, 10]]) + origin
    cv2.fillPoly(image, [arrow.astype(np.int32)], BEAM, cv2.LINE_AA)
    image[:44] = _panel(WIDE, 44, f"/scan   LaserScan, {len(scan.ranges)} ranges")
    return image


def _in_perspective(points: Array) -> Image:
    title = f"/points   PointCloud2, {len(points)} points, coloured by height"
    image = _panel(WIDE, HIGH, title)
    points = points[np.isfinite(points).all(axis=1)]
    eye, target = np.array([-6.2, -4.4, 5.6]), np.array([0.4, 0.3, -0.5])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    # Points on the side of the viewer are left out, because they would hide the others.
    towards_eye = (eye - target)[:2] / np.linalg.norm((eye - target)[:2])
    points = points[((points[:, :2] - target[:2]) @ towards_eye < 2.2) | (points[:, 2] < -0.6)]
    view = (points - eye) @ np.stack([right, -np.cross(right, forward), forward], axis=1)
    depth = view[:, 2]
    x, y = (WIDE * view[:, :2] / depth[:, None] + (WIDE / 2, HIGH / 2)).round().astype(int).T
    colours = _colours(points[:, 2], -0.9, 1.7).astype(float)
    # Far points fade into the background.
    near = (1.25 - depth / 16).clip(0.35, 1)[:, None]
    colours = near * colours + (1 - near) * PAPER
    for i in np.argsort(-depth):
        if 2 < x[i] < WIDE - 2 and 46 < y[i] < HIGH - 2:
            image[y[i] - 1 : y[i] + 1, x[i] - 1 : x[i] + 1] = colours[i]
    return image


def _distances(points: Array, width: int) -> Image:
    rows, columns = points.shape[:2]
    title = f"distances of the cloud: {rows} rows by {columns} columns, the left column is at the left"
    image = _panel(width, STRIP + 44 + MARGIN, title)
    distances = np.linalg.norm(points, axis=2)
    # Row 0 is the lowest, column 0 the rightmost one.
    coloured = _colours(-np.nan_to_num(distances, nan=1e3).reshape(-1), -6.0, -0.5).reshape(rows, columns, 3)
    coloured[np.isnan(distances)] = GRID
    strip = cv2.resize(coloured[::-1, ::-1], (width - 2 * MARGIN, STRIP), interpolation=cv2.INTER_AREA)
    image[44 : 44 + STRIP, MARGIN : width - MARGIN] = strip
    return image
