"""The demo's pictures."""
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import yaml

from recordings import compose, inverse


def read_map(directory):
    """(grey image with row 0 at the bottom, (left, right, bottom, top) in metres)."""
    with open(directory / "map.yaml", encoding="utf-8") as text:
        info = yaml.safe_load(text)
    with open(directory / info["image"], "rb") as pgm:
        fields = []
        while len(fields) < 4:
            line = pgm.readline().split(b"#")[0]
            fields += line.split()
        width, height = int(fields[1]), int(fields[2])
        image = np.frombuffer(pgm.read(width * height), np.uint8).reshape(height, width)
    x, y = info["origin"][0], info["origin"][1]
    resolution = info["resolution"]
    return image[::-1], (x, x + width * resolution, y, y + height * resolution)


def _draw_map(axes, directory):
    image, extent = read_map(directory)
    axes.imshow(image, cmap="gray", vmin=0, vmax=255, origin="lower", extent=extent, interpolation="nearest")
    known = np.argwhere(image != 205)
    if len(known):
        (y0, x0), (y1, x1) = known.min(0), known.max(0)
        step = (extent[1] - extent[0]) / image.shape[1]
        axes.set_xlim(extent[0] + (x0 - 10) * step, extent[0] + (x1 + 10) * step)
        axes.set_ylim(extent[2] + (y0 - 10) * step, extent[2] + (y1 + 10) * step)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def map_picture(directory, places, path):
    figure, axes = plt.subplots(figsize=(12, 8))
    _draw_map(axes, directory)
    for name, (x, y, _) in places.items():
        axes.plot(x, y, "b.", markersize=8)
        axes.annotate(name, (x, y), color="b", xytext=(4, 4), textcoords="offset points")
    axes.set_title("The map built from the mapping drive")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def trajectory_picture(directory, drives, map_world, goals, path):
    """drives: a (title, recording, estimate) each; truth is brought into the map's frame, odometry starts on truth."""
    figure, all_axes = plt.subplots(1, len(drives), figsize=(9 * len(drives), 7), squeeze=False)
    for axes, (title, recording, estimate) in zip(all_axes[0], drives):
        _draw_map(axes, directory)
        truth = np.array([compose(map_world, pose) for pose in recording.truth.poses])
        odometry = recording.odometry.poses
        first = compose(tuple(truth[0]), inverse(odometry[0]))
        odometry = np.array([compose(first, pose) for pose in odometry])
        axes.plot(odometry[:, 0], odometry[:, 1], color="tab:orange", linewidth=1, label="odometry alone")
        axes.plot(truth[:, 0], truth[:, 1], color="tab:green", linewidth=2.5, label="truth")
        if estimate.poses:
            seen = np.array(estimate.poses)
            axes.plot(seen[:, 0], seen[:, 1], color="tab:red", linewidth=1, label="estimate")
        axes.set_title(title)
        axes.legend(loc="upper right")
    for name, (x, y, _) in goals.items():
        all_axes[0][-1].plot(x, y, "b*", markersize=10)
        all_axes[0][-1].annotate(name, (x, y), color="b", xytext=(4, 4), textcoords="offset points")
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    plt.close(figure)

