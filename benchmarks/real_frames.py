"""Draw six frames of a real street, one per camera of PandaSet: image with scores, occupancy, map and labels.

    python benchmarks/real_frames.py --pandaset FOLDER --out docs/results/real_frames.jpg

The filter runs over the last five frames of a camera, and the last one is drawn. Above each map stands how many of the
cells are right in which a labelled return of the frame's own scan lies in view of the camera. The most frequent errors
are printed.
"""

import argparse

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.datasets.pandaset import CAMERAS, PandasetScene
from semgrid_edu.datasets.samples import real_weights
from semgrid_edu.fast import load_net
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.pipeline import FrameResult, Stages, network_image, run_pipeline
from semgrid_edu.plotting.colours import colour_patches
from semgrid_edu.plotting.images import blend_labels, draw_image

SPEC, SEEN = GridSpec.compact(), 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pandaset", required=True, help="the folder that holds the scenes")
    parser.add_argument("--scene", default="002")
    parser.add_argument("--weights", default=real_weights(), help="a trained network; the shipped one when left out")
    parser.add_argument("--out", required=True, help="a PNG or JPEG file")
    arguments = parser.parse_args()
    fig, axes = plt.subplots(len(CAMERAS), 4, figsize=(9, 15), width_ratios=(3.6, 1, 1, 1), layout="constrained")
    for row, camera in zip(axes, CAMERAS, strict=True):
        scene = PandasetScene(arguments.pandaset, arguments.scene, camera)
        k = len(scene) - 1
        *_, last = run_pipeline(scene[-SEEN:], Stages.of(load_net(arguments.weights, scene.camera), keep_steps=True))
        labels = np.where(scene.undecided(k, SPEC), scene.truth(k, SPEC, 0, 0), np.uint8(IGNORE))
        draw_frame(row, f"{camera}, {last.frame.time:.1f} s", last, labels)
    for ax in axes[:, 1]:
        ax.set_ylabel("x, forward [m]", fontsize=8)
    for ax in axes[-1, 1:]:
        ax.set_xlabel("y, to the left [m]", fontsize=8)
    names = colour_patches(KITTI_14.names, KITTI_14.rgb)
    fig.legend(handles=names, loc="outside lower center", ncols=5, fontsize=8, title=scene.credit, title_fontsize=8)
    fig.savefig(arguments.out, dpi=plotting.FIGURE_DPI)


def draw_frame(axes: NDArray, name: str, result: FrameResult, labels: NDArray) -> None:
    """Draw a frame into a row of four axes."""
    called = result.grid.argmax(axis=0)
    small = np.rint(255 * network_image(result.frame, result.scores.shape[1:]).transpose(1, 2, 0)).astype(np.uint8)
    draw_image(blend_labels(small, result.scores.argmax(axis=0), KITTI_14, 0.5), axes[0]).set_title(name, fontsize=9)
    plotting.occupancy(SPEC, result.belief.probability, axes[1], legend=False)
    plotting.grid_labels(SPEC, called, KITTI_14, axes[2], legend=False)
    plotting.grid_labels(SPEC, labels, KITTI_14, axes[3], legend=False)
    right = (called == labels)[labels != IGNORE].mean()
    print(f"{name}: {right:.1%} of {(labels != IGNORE).sum()} cells right; {errors(labels, called)}", flush=True)
    for ax, title in zip(axes[1:], ("occupancy", f"map: {right:.0%} right", "labels"), strict=True):
        ax.set_title(title, fontsize=9)
        only_near(ax)


def errors(labels: NDArray, called: NDArray) -> str:
    """Name the five most frequent errors, with their numbers of cells."""
    counts = confusion_matrix(labels, called, len(KITTI_14))
    np.fill_diagonal(counts, 0)
    worst = [np.unravel_index(k, counts.shape) for k in np.argsort(-counts, axis=None, kind="stable")[:5]]
    return ", ".join(f"{counts[c, d]} {KITTI_14.names[c]} called {KITTI_14.names[d]}" for c, d in worst)


def only_near(ax: Axes) -> None:
    """Show a map up to 50 m ahead, without words on its axes."""
    ax.set(ylim=(0, 50), xlabel="", ylabel="")
    ax.tick_params(labelsize=8)


if __name__ == "__main__":
    main()
