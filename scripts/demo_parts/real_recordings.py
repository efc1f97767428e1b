#!/usr/bin/python3
"""Pictures of docs/real_recordings.md: real_recordings.py csail WORK DATA OUT | depth WORK NAME OUT"""
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np


def read_poses(path):
    """Rows of t, x, y, yaw, from TUM text or `t x y theta`."""
    rows = []
    for line in open(path, encoding="utf-8"):
        if line.strip() and not line.startswith("#"):
            v = [float(field) for field in line.split()]
            rows.append([v[0], v[1], v[2], v[3] if len(v) == 4 else 2 * np.arctan2(v[6], v[7])])
    return np.array(rows)


def start_on(poses, reference):
    """The poses moved so that at the reference's first stamp they coincide."""
    i = np.argmin(abs(poses[:, 0] - reference[0, 0]))
    turn = reference[0, 3] - poses[i, 3]
    c, s = np.cos(turn), np.sin(turn)
    moved = (poses[:, 1:3] - poses[i, 1:3]) @ np.array([[c, s], [-s, c]]) + reference[0, 1:3]
    return moved


def csail(work, data, out):
    reference = read_poses(data / "mit-csail.reference_from_relations.txt")
    figure, axes = plt.subplots(1, 2, figsize=(14, 6.5))
    for axis, fov in zip(axes, (57, 180)):
        for name, color, width in (("odometry", "tab:orange", 1), (str(fov), "tab:red", 1.3)):
            moved = start_on(read_poses(work / f"csail_{name}.tum"), reference)
            axis.plot(moved[:, 0], moved[:, 1], color=color, linewidth=width,
                      label="odometry alone" if name == "odometry" else f"local mapper, {fov} degrees")
        axis.plot(reference[:, 1], reference[:, 2], color="tab:green", linewidth=2, label="reference")
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
        axis.set_ylabel("y [m]")
        axis.legend()
        low, high = reference[:, 1:3].min(0) - 8, reference[:, 1:3].max(0) + 8
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
    figure.tight_layout()
    figure.savefig(out / "mit_csail_trajectories.png", dpi=80)
    figure, axes = plt.subplots(1, 2, figsize=(14, 7))
    for axis, fov in zip(axes, (57, 180)):
        axis.imshow(matplotlib.image.imread(work / f"csail_{fov}" / "tsdf.png"))
        axis.set_title(f"signed distance at the end, {fov} degrees")
        axis.axis("off")
    figure.tight_layout()
    figure.savefig(out / "mit_csail_tsdf.png", dpi=80)


def depth(work, name, out):
    profiles = np.genfromtxt(work / f"{name}.profiles.csv", delimiter=",")
    figure, axes = plt.subplots(1, 2, figsize=(14, 5.5), gridspec_kw={"width_ratios": [1.3, 1]})
    image = axes[0].imshow(profiles[:, 1:], aspect="auto", cmap="viridis", vmin=0, vmax=np.nanpercentile(profiles[:, 1:], 99))
    axes[0].set_xlabel("column [px]")
    axes[0].set_ylabel("frame")
    axes[0].set_title("depth profiles [m]; white: no obstacle seen")
    figure.colorbar(image, ax=axes[0])
    picture = matplotlib.image.imread(work / name / "scan_360.png")
    quarter = [side * 3 // 8 for side in picture.shape[:2]]  # the middle 5 m of 20
    axes[1].imshow(picture[quarter[0]:-quarter[0], quarter[1]:-quarter[1]])
    axes[1].set_title("local map and virtual scan at the end, 5 x 5 m")
    axes[1].axis("off")
    figure.tight_layout()
    figure.savefig(out / f"{name}.png", dpi=80)


def main():
    kind, work, what, out = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3], pathlib.Path(sys.argv[4])
    if kind == "csail":
        csail(work, pathlib.Path(what), out)
    else:
        depth(work, what, out)


if __name__ == "__main__":
    main()
