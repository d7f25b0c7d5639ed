"""Draws the swing-up: images of the camera in a row, and below them the angle of the pole and the expected cost.

Needs matplotlib.
"""

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

SHOWN = (0.1, 0.9, 2.0, 3.1, 3.6, 4.1, 6.0)
"""Times of the images in the picture [s]."""

GHOSTS = 4
"""Number of earlier images that are visible in each."""

INK, ORANGE, BLUE = "#22262b", "#e8690b", "#2a6fb0"


def with_motion(images, time):
    """Returns the time and the image that are nearest to a time, with traces of the images before it.

    Args:
        images: Times [s] and messages of the camera.
        time: The time [s].
    """
    frames = [np.frombuffer(one.data, np.uint8).reshape(one.height, one.width, 3) for _, one in images]
    background = np.median(frames, axis=0)
    index = min(range(len(images)), key=lambda i: abs(images[i][0] - time))
    picture = background.copy()
    for frame in frames[max(0, index - GHOSTS) : index]:
        moved = np.abs(frame - background).max(axis=2) > 24
        picture[moved] = 0.7 * picture[moved] + 0.3 * frame[moved]
    moved = np.abs(frames[index] - background).max(axis=2) > 12
    picture[moved] = frames[index][moved]
    return images[index][0], picture.astype(np.uint8)


def draw(rows, images, path):
    """Draws the picture.

    Args:
        rows: Time [s], position of the cart [m], angle of the pole [rad] and expected cost, shape (n, 4).
        images: Times [s] and messages of the camera.
        path: The file.
    """
    plt.rcParams.update({"font.size": 11, "text.color": INK, "axes.edgecolor": INK, "axes.labelcolor": INK})
    figure = plt.figure(figsize=(12, 5.6), layout="constrained", facecolor="white")
    strip, charts = figure.subfigures(2, 1, height_ratios=(1.0, 1.3))
    for time, axes in zip(SHOWN, strip.subplots(1, len(SHOWN)), strict=True):
        nearest, image = with_motion(images, time)
        axes.imshow(image)
        axes.set(xticks=[], yticks=[])
        axes.text(0.05, 0.96, f"{nearest:.1f} s", transform=axes.transAxes, va="top", weight="bold")
        for side in axes.spines.values():
            side.set_visible(False)

    time, _, angle, expected = rows.T
    left, right = charts.subplots(1, 2)
    turns = 360.0 * np.round(angle[-1] / (2.0 * np.pi))
    left.plot(time, np.degrees(angle) - turns, color=ORANGE, lw=2.2)
    left.axhline(0.0, color=INK, lw=0.8, ls=":")
    left.set(xlabel="simulated time [s]", title="Pole, 0 is upright [degrees]")
    right.plot(time, expected, color=BLUE, lw=2.2)
    right.set(xlabel="simulated time [s]", title="Mean cost of a state in the best simulated plan", yscale="log")
    for axes in (left, right):
        axes.set_xlim(0.0, time[-1])
        axes.grid(color="#e3e6e9")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)
