# %% [markdown]
# # Companion · The domain gap, measured
#
# **In one sentence.** A network meets images unlike those that it learned from; how unlike they are can be measured
# without a label, but that distance isn't the damage, and making it zero is no cure.
#
# **You will be able to**
# - measure how far the images of a drive are from those that a network learned from, and hold that against a yardstick;
# - say what such a distance leaves out, from an experiment in which the damage is known;
# - judge a cure by more than one number.
#
# **Prerequisites.** Lecture [13](../13_real_drive.ipynb), beside which this companion stands.
#
# **Time.** 27 minutes, of which the computer needs less than one.
#
# The real images of this page are those of the street that comes with the course, and two stretches of KITTI's drive
# 0013, its frames 0 to 23 and 24 to 60. That drive doesn't come with the course; its numbers were measured once.

# %% jupyter={"source_hidden": true}
import json
import sys

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import real_drive, sample_drive, sample_image_stage
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import load_net
from semgrid_edu.storage.files import shipped_folder

# %% jupyter={"source_hidden": true}
sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_13_domain import (
    agrees_with_lidar, class_probabilities, colour_distance, image_statistics, match_colours, mean_histograms, mean_over,
    training_images,
)  # fmt: skip

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
measured = json.loads((shipped_folder("docs") / "results" / "real_drive.json").read_text(encoding="utf-8"))
CALLED = {"stretch 1": "drive 0013, frames 0-23", "stretch 2": "drive 0013, frames 24-60", "sample": "sample drive"}
drives = {CALLED[name]: one for name, one in measured["drives"].items()}
street = real_drive()[:]
tester = load_net(sample_image_stage(), sample_drive().camera)
size, known = tester.architecture.image_size, mean_histograms(training_images())

# %% [markdown]
# ## How far apart are two kinds of images?
#
# A network that learned from one kind of image meets another kind. This is called the **domain gap**. How far apart
# are the two kinds? Compare histograms. By hand, with two bins, dark and bright: images of the training set have 3/4
# of their pixels dark, new ones 1/4. Half the sum of the absolute differences is (1/2 + 1/2) / 2 = 1/2. This is the
# **total variation** between two distributions, from 0 (equal) to 1 (nothing in common):
#
# $$ d(p, q) = \tfrac{1}{2} \sum_b |p_b - q_b| $$
#
# The **colour distance** is its mean over red, green and blue, with 32 bins $b$ each. The training images here are the
# six of 142 that come with the course.


# %% tags=["distance"]
def histogram_distance(p, q):
    """Return half the sum of absolute differences."""
    return np.abs(np.asarray(p) - q).sum() / 2


print(histogram_distance([0.75, 0.25], [0.25, 0.75]))
small = [resize_image(frame.image, size) for frame in street]
seen = mean_histograms(small)
by_colour = [histogram_distance(seen[name], known[name]) for name in ("red", "green", "blue")]
np.testing.assert_allclose(colour_distance(seen, known), np.mean(by_colour))
among = measured["training images"]["colour distance"]
print(f"the real street: {colour_distance(seen, known):.2f}")
print(f"one training image from the others: {min(among):.2f} to {max(among):.2f}")
for name, one in drives.items():
    print(f"{name}: {one['images']['colour distance']:.2f}")
    assert (one["images"]["colour distance"] > max(among)) == (name != "sample drive")

# %% jupyter={"source_hidden": true} alt="left: histograms of brightness of red, green and blue, solid for the training images and dashed for the real street, whose dashed curves have more dark pixels; right: colour distance of single training images, of the sample drive, of the real street and of two stretches of drive 0013, of which the real ones lie farthest"
fig, axes = plt.subplots(1, 2, figsize=(10, 3), layout="constrained")
at = np.arange(4, 256, 8)
for name, colour, mark in (("red", "#d62728", "o"), ("green", "#2ca02c", "s"), ("blue", "#1f77b4", "^")):
    axes[0].plot(at, known[name], color=colour, marker=mark, ms=3, label=f"{name}, training images")
    axes[0].plot(at, seen[name], color=colour, marker=mark, ms=3, linestyle="--", label=f"{name}, real street")
axes[0].set(xlabel="value of a pixel", ylabel="share of pixels")
axes[0].legend(frameon=False, fontsize=8)
points = {"training images, each against the others": among}
points |= {name: [one["images"]["colour distance"]] for name, one in drives.items()}
points["the real street"] = [colour_distance(seen, known)]
for place, values in enumerate(points.values()):
    axes[1].plot(values, [place] * len(values), "o" if place < 2 else "D", color="0.3" if place < 1 else "#d95f02")
axes[1].set_yticks(range(len(points)), [name.replace(", ", ",\n") for name in points])
axes[1].invert_yaxis()
axes[1].set(xlabel="colour distance", xlim=(0, 0.7))
plt.show()

# %% [markdown]
# Left you see what the distance compares: solid lines are the six training images, dashed lines the images of the real
# street. Right, each mark is a distance, a diamond one of real images. The grey dots are the yardstick: each training
# image against the five others. The sample drive lies below them. The real street lies just beyond the farthest grey
# dot, drive 0013 farther. (Histograms of a drive are means of several images, which evens out what differs from image
# to image; that brings a drive nearer, not farther.) What is different about real images?

# %%
rows = {"training images": measured["training images"]} | {name: one["images"] for name, one in drives.items()}
rows["the real street"] = mean_over(small, image_statistics)
numbers = ("brightness", "contrast", "saturation", "edges")
print(f"{'':<25}", *(f"{what:>11}" for what in numbers))
for name, one in rows.items():
    print(f"{name:<25}", *(f"{one[what]:11.1f}" for what in numbers))
for what in ("contrast", "saturation", "edges"):
    assert 0.9 < rows["the real street"][what] / rows["training images"][what] < 1.15
for name in (CALLED["stretch 1"], CALLED["stretch 2"]):
    assert rows[name]["edges"] > 1.5 * rows["training images"]["edges"]
    assert rows[name]["contrast"] > 1.4 * rows["training images"]["contrast"]

# %% [markdown]
# *Brightness* is the mean grey value, *contrast* its standard deviation, *saturation* the mean difference of the
# largest and the smallest of red, green and blue, and *edges* the mean gradient. On drive 0013 contrast and edges are
# larger than in the training images by 59 to 72 %: one image has a black car, deep shadows of trees and a bright sky.
# The real street is about as dark as drive 0013, but its contrast is larger by only an eighth, and its saturation and
# edges hardly differ. And yet the map that the network makes of it is no better than *always road* (lecture 13).
#
# ## Is the distance the damage?
#
# **Predict before you run.** We change the sample images in seven ways, and measure each time the colour distance to
# the training images and the share of right pixels. (Printed as well: *confidence*, the mean
# probability of the class that is called, and *lane*, the share of LIDAR returns from the ground of our own lane whose
# pixels are called road.) If the distance were the damage, the larger distance would always have the lower share. What
# do you expect for an image that is a little warmer (red x 1.15, blue x 0.8), compared with one at half the brightness?
#
# <details><summary>Answer</summary>
#
# Half the brightness lies much farther away than the warmer light, and yet it does less damage. Noise does most damage
# of all and hardly changes the distance.
#
# </details>


# %%
def bytes_of(values):
    """Return numbers as an image."""
    return np.clip(values, 0, 255).astype(np.uint8)


CHANGES = {
    "as it is": lambda image: image,
    "half as bright": lambda image: bytes_of(0.5 * image),
    "contrast x 1.6": lambda image: bytes_of(1.6 * (image - image.mean()) + image.mean()),
    "warmer": lambda image: bytes_of(image * [1.15, 1, 0.8]),
    "red and blue swapped": lambda image: np.ascontiguousarray(image[..., ::-1]),
    "blurred": lambda image: bytes_of(gaussian_filter(image.astype(float), (1, 1, 0))),
    "noise": lambda image: bytes_of(image + np.random.default_rng(0).normal(0, 20, (*image.shape[:2], 1))),
    "colours matched": lambda image: match_colours(image, np.stack(training_images())),
}
tested = sample_drive()[::4]

# %% jupyter={"outputs_hidden": true}
damage = {}
for name, change in CHANGES.items():
    images, scores = [change(resize_image(frame.image, size)) for frame in tested], []
    for frame, image in zip(tested, images, strict=True):
        probability, truth = class_probabilities(tester, image), resize_labels(frame.labels.image, size)
        said = probability.argmax(axis=0)
        lane = agrees_with_lidar(frame, said).lane
        scores.append([(said == truth)[truth != IGNORE].mean(), probability.max(axis=0).mean(), lane])
    damage[name] = colour_distance(mean_histograms(images), known), *np.mean(scores, axis=0)
    distance, accuracy, confidence, lane = damage[name]
    print(f"{name:<21} distance {distance:.2f}   right {accuracy:.2f}   confidence {confidence:.2f}   lane {lane:.2f}")
for k in (0, 1):  # nearer, and yet worse
    assert damage["warmer"][k] < damage["half as bright"][k]
assert damage["noise"][1] == min(one[1] for one in damage.values())
assert damage["colours matched"][0] == min(one[0] for one in damage.values())

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="scatter of share of right pixels against colour distance for eight versions of the sample images; noise and warmer light lie low at small distances, half brightness lies higher at the largest distance"
fig, ax = plt.subplots(figsize=(7.5, 3.2), layout="constrained")
for name, (distance, accuracy, *_) in damage.items():
    ax.plot(distance, accuracy, "o", color="#d95f02")
    below = name in ("as it is", "warmer", "colours matched")
    ax.annotate(name, (distance, accuracy), xytext=(6, -12 if below else 4), textcoords="offset points")
ax.set(xlabel="colour distance to the training images", ylabel="share of right pixels", xlim=(0, 0.8), ylim=(0.2, 0.95))
plt.show()

# %% [markdown]
# The dots don't lie on a falling line. A distance of histograms tells you *that* the images are different, and not what
# follows from it. The last line is even more instructive: after `match_colours` the distance is nearly zero, and the
# network does no better. (The function gives an image the training images' histogram, colour by colour.) And look
# at *red and blue swapped*: fewer pixels are right, but the lane column says little of it. A check with two classes can
# be blind to a third.
#
# Would matching the colours at least help on a real drive? There we can only ask the LIDAR about the lane, and about
# what is *standing*: the share of returns from half a metre to three metres up whose pixels are called something that
# stands.

# %%
for name, one in drives.items():
    for what in ("image network", "image network, colours matched"):
        numbers = {key: round(value, 2) for key, value in one[what].items()}
        print(f"{name:<25} {what:<30}", numbers)
    lane, standing = (
        one["image network, colours matched"][what] - one["image network"][what] for what in ("lane", "standing")
    )
    assert name == "sample drive" or (lane > 0.03 and standing < 0)

# %% [markdown]
# It helps in one place and harms in another. With matched colours the lane agrees better on both stretches. The
# standing things agree worse, much worse on the first stretch. (A network that simply said road more often would gain
# on the lane and lose on what stands.) With the lane's number alone we would have called it a cure. (*Entropy* tells how
# evenly a pixel's probability is spread over the classes: 0 if one class has all of it, 1 if all have the same.)
#
# ## What one would do
#
# Lecture 13 does the first of these in a second. The others are options, with what each of them asks for:
#
# - **Fine-tune.** Train on with a few labelled images of the new domain. It needs labels there, and a place to test
#   from which you haven't learned.
# - **Augment.** Train in simulation with more variation of what we have just measured: brightness, white balance,
#   contrast, noise, sharpness. It needs no real data. `semgrid-edu train` varies the first and contrast already, and
#   with `--tint` colours.
# - **Self-train.** Let the network label real images, keep the labels that something independent confirms, and train on
#   them. The two rules about lane and standing things are such a confirmation. The danger: what it believes wrongly and
#   surely, it learns again.
# - **Start from ImageNet**, as the paper does: weights that have seen real images.
#
# Whichever you choose: hold back whole drives for testing, and report all checks beside the score.
#
# ## What this does not show
#
# Two real streets, a few seconds of each, and one network. That the seven changes of a simulated image do what
# real light and real lenses do, we don't know; they only show that a distance and the damage can come apart.
#
# ## In five lines
#
# 1. How unlike two kinds of images are can be measured without a label: half the sum of the differences of their
#    histograms.
# 2. Such a number needs a yardstick: how far the training images lie from each other.
# 3. It isn't the damage: noise hardly changed the distance and did most harm.
# 4. Matching the colours made the distance nearly zero, helped with the lane and harmed what stands.
# 5. So judge a cure by more than one number, on drives that were held back.
#
# ## Further reading
#
# - Ben-David, Blitzer, Crammer, Kulesza, Pereira, Vaughan, *A theory of learning from different domains*, Machine
#   Learning 79, 2010: when a distance of domains does bound the damage.
# - Hendrycks, Dietterich, *Benchmarking neural network robustness to common corruptions and perturbations*, ICLR 2019:
#   changes like ours, done properly.
