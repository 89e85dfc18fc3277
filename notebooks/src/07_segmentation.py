# %% [markdown]
# # 07 · Three networks for segmentation
#
# **In one sentence.** To call a pixel *pole*, a network must know what is around it, and exactly where it is; halving
# the image gains the first and loses the second, and three networks get it back in three ways: indices, skips, atrous
# convolutions.
#
# **You will be able to**
# - turn scores into a loss by hand, and say why scores, not probabilities, go on to the planes;
# - compute a convolution with any stride and rate, and how much of the image a chain of them sees;
# - unpool by indices, add a skip, spread a kernel, each on a few numbers, and say what each does to a thin pole;
# - read the accuracy of three trained networks, and name what one number hides;
# - recognise patterns that are made by the network and not by the world.
#
# **Prerequisites.** Lecture 00. Lecture 06, for bilinear sampling and what a gradient is. No deep learning.
#
# **Time.** 115 minutes, best in two sittings; the computer needs less than one.
#
# **Paper.** Section 3.1, which names the three networks: SegNet, FCN and DeepLab v2. Their own publications are at
# the end.
#
# ```
# image i (3, h, w) ── convolve, halve, convolve, halve: what is it? ──▶ a small map
#                                                                           │
# scores s (C, h, w) ◀── back to the size of the image: where is it? ───────┘
# ```

# %%
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from ipywidgets import IntSlider, interact

from semgrid_edu import plotting
from semgrid_edu.datasets.readers.frames import resize_labels
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.datasets.samples import sample_drive, sample_image_stage
from semgrid_edu.workshop.illustrations.thin_pole import draw_poles, score_poles, train_pole_net
from semgrid_edu.workshop.illustrations.thin_pole import MECHANISMS, apply_mechanism, place_and_width
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy

# %%
from semgrid_edu.networks import build_segmenter, load_net
from semgrid_edu.networks.backbones.deeplab import interpolate
from semgrid_edu.networks.backbones.fcn import enlarge
from semgrid_edu.networks.imagenet import imagenet_tensors
from semgrid_edu.plotting.images import draw_image

plt.rcParams["figure.dpi"] = 72
plt.rcParams["image.interpolation"] = "nearest"  # pixels stay pixels
POLE, PEDESTRIAN = KITTI_14.index("signage"), KITTI_14.index("pedestrian")


def to_torch(array):
    """(h, w) or (w,) -> (1, 1, h, w), double: what PyTorch's layers take."""
    return torch.from_numpy(np.atleast_2d(np.asarray(array, float)))[None, None]


# %% [markdown]
# New words, beside the symbols of lecture 00:
#
# | symbol | meaning | name in code |
# |---|---|---|
# | $s_c$ | score of class $c$ at one pixel | `scores[c, v, u]` |
# | $c^*$ | true class of a pixel; 255 where nobody has labelled it | `truth[v, u]` |
# | kernel | the weights of a convolution | `kernel[n, m]` |
# | stride | the outputs of a layer lie this many of its inputs apart | `stride` |
# | rate | the weights of a kernel lie this many inputs apart | `rate`; `dilation` in PyTorch |
# | jump | neighbours in a map lie this many pixels of the *image* apart | `jump` |
#
# KITTI's labels have one class for signs and poles, *signage*; pictures paint it yellow.
#
# ## What comes out: a score for each class
#
# One pixel, three classes: road, pole, sky. A network gives the scores 1, 3, 0. They are no probabilities, just
# numbers; the largest says pole. To make probabilities of them, exponentiate and divide by the sum: *soft-max*. By
# hand: $e^1 = 2.72$, $e^3 = 20.09$, $e^0 = 1$; the sum is 23.8; so 0.11, 0.84, 0.04.
#
# Is that good? If the pixel truly is pole, its *cross-entropy* is $-\log 0.84 = 0.17$; if it is road, it is $-\log
# 0.11 = 2.17$. The loss of an image is the mean over its labelled pixels.
#
# **Predict before you run.** Add 5 to all three scores: how does the loss change? And a picture has three pixels; the
# losses of two are 0.17 and 2.17, and the third isn't labelled: what is the loss of the picture?
#
# <details><summary>Answer</summary>Adding changes nothing: e<sup>5</sup> stands above and below, and cancels. The
# loss of the picture is the mean of two, 1.17, not of three: a pixel that nobody has labelled counts neither above
# nor below.</details>
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}}, \qquad
#    \text{loss} = -\frac{1}{\text{labelled pixels}} \sum_{\text{labelled pixels}} \log P(c^*) $$


# %% tags=["segmentation"]
def cross_entropy(scores, truth, ignore=IGNORE):
    """Mean of -log P(true class) over the labelled pixels; scores (C, h, w), truth (h, w)."""
    losses = []
    for v, u in np.ndindex(truth.shape):
        if truth[v, u] != ignore:
            odds = np.exp(scores[:, v, u])
            losses.append(-np.log(odds[truth[v, u]] / odds.sum()))
    return np.mean(losses)


scores = np.tile(np.array([1.0, 3.0, 0.0]).reshape(3, 1, 1), (1, 1, 3))
truth = np.array([[1, 0, 255]])  # pole, road, nobody knows
by_torch = F.cross_entropy(torch.tensor(scores)[None], torch.tensor(truth)[None], ignore_index=IGNORE)
np.testing.assert_allclose(cross_entropy(scores, truth), by_torch)
print(f"loss {cross_entropy(scores, truth):.2f}, and with 5 added to all scores {cross_entropy(scores + 5, truth):.2f}")

# %% [markdown]
# What does a network learn from it? The derivative by each score is **probability minus truth**. Here, for a true
# pole: 0.11, 0.84 - 1 = -0.16, 0.04. So a step of gradient descent raises the score of the true class, and lowers
# each other as much as it was believed. Let PyTorch differentiate, and compare:

# %%
s = torch.tensor([1.0, 3.0, 0.0], dtype=torch.float64, requires_grad=True)
F.cross_entropy(s[None], torch.tensor([1])).backward()
np.testing.assert_allclose(s.grad, torch.softmax(s.detach(), dim=0) - torch.tensor([0, 1, 0]))
print("gradient:", s.grad.numpy().round(2))

# %% [markdown]
# ### Why no soft-max before the planes
#
# The paper hands the *scores* to the planes of lectures 05 and 06. Take two neighbours, and one class against one
# other. On the left pole leads by 6, on the right it trails by 1: nearly sure, and a shrug. A point of a plane falls
# halfway between the two.
#
# **Predict before you run.** How probable is pole at that point if you interpolate scores? If you interpolate
# probabilities?
#
# <details><summary>Answer</summary>Scores: a lead of 2.5, that is 0.92. Probabilities: (0.998 + 0.269) / 2 = 0.63.
# With scores, the pixel that knows more counts more.</details>


# %%
def logistic(lead):
    """The soft-max of two classes, by how far the one leads."""
    return 1 / (1 + np.exp(-np.asarray(lead, float)))


lead = np.array([6, -1])
print(f"scores interpolated {logistic(lead.mean()):.2f}, probabilities interpolated {logistic(lead).mean():.2f}")
for lead in (0, 6, 12):
    P = logistic(lead)
    print(f"lead {lead:2d}: P = {P:.6f}, slope P (1 - P) = {P * (1 - P):.6f}")

# %% [markdown]
# Three reasons, then. Scores are logarithms, and what comes next, a 1x1 convolution over all planes (lecture 08), is
# a sum: adding logarithms multiplies evidence, as in lecture 02. A soft-max forgets how strong evidence was: leads of
# 6 and of 12 are nearly the same to it. And its slope is all that a gradient coming back from the grid would find:
# through a pixel that is sure, hardly anything gets.
#
# The same on the drive. This is the image network of the course's trained net after its first stage: it has learnt
# from labelled images, and has seen no grid yet. No training has seen this street.

# %%
drive = sample_drive()
frames = [drive[k] for k in range(len(drive))]
SIZE = (96, 320)  # what the compact networks see
images = np.stack([resize_image(frame.image, SIZE) for frame in frames])
truths = np.stack([resize_labels(frame.labels.image, SIZE) for frame in frames])
NAMES = {"segnet": "SegNet", "fcn": "FCN-8s", "deeplab": "DeepLab v2", "unet": "U-Net"}
TRAINED = ("segnet", "fcn", "deeplab")
nets = {name: load_net(sample_image_stage(name), frames[0].camera).segmenter for name in TRAINED}


def as_input(images):
    """(B, h, w, 3) uint8 -> (B, 3, h, w) float, 0..1."""
    return torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255


with torch.inference_mode():
    s = nets["segnet"](as_input(images[8:9]))[0]
P = torch.softmax(s, dim=0)
assert torch.allclose(P.sum(dim=0), torch.ones(SIZE), atol=1e-5)
print("image", images[8].shape, "-> scores", tuple(s.shape))

# %% [markdown]
# Under a soft-max one score by itself says nothing, as your prediction showed: any number may be added to all of a
# pixel's scores. On the planes of lecture 08 that no longer holds, because a point that no pixel shows gets zeros, so
# the scores carry a zero there: "nobody looked". What counts is
# the *lead* of a class, its score minus the largest of the others.


# %%
def lead_of(c, scores):
    """By how much class c leads, (C, h, w) -> (h, w); negative where another one does."""
    others = torch.cat([scores[:c], scores[c + 1 :]]).max(dim=0).values
    return scores[c] - others


fig, axes = plt.subplots(3, 1, figsize=(4.9, 5.2), layout="compressed")
draw_image(images[8], ax=axes[0]).set_title("image i, frame 8")
plotting.image_values(lead_of(POLE, s), "lead", ax=axes[1], cmap="PuOr_r", vmin=-4, vmax=4).set_title("lead of signage")
draw_image(KITTI_14.colours(s.argmax(dim=0)), ax=axes[2]).set_title("the class with the largest score")
plotting.class_legend(axes[2], KITTI_14, s.argmax(dim=0), loc="upper left", bbox_to_anchor=(0, -0.02), ncols=4)
plt.show()

# %% [markdown]
# In the middle, orange is where signage leads. There is a lamp post in this picture, right of the cyclist, and the thin
# post of a warning sign to its left. The network notices that something of the kind is there, and has no idea of its
# outline; it takes tree tops for signs as well. Why thin things are so hard is the subject of this lecture.
#
# ## Down: to see what is around
#
# ### A convolution, by hand
#
# A row of eight pixels: a pole one pixel wide, and a door two pixels wide.
#
# ```
# row                 0    0    1    0    0    1    1    0
# kernel -1 2 -1      0   -1    2   -1   -1    1    1   -1      twice a pixel, minus its two neighbours
# ```
#
# What is thin gets a 2, what is wider gets less, and inside of something wide there would be a 0. Set negative values
# to zero (*ReLU*), and you have a detector of thin things. A layer of a network is a few dozen such kernels; their
# weights are learnt.
#
# A layer may take fewer outputs than it has inputs: with **stride** 2 it computes only every second one.
#
# **Predict before you run.** Of the outputs above, stride 2 keeps those of columns 0, 2, 4, 6: 0, 2, -1, 1. Now the
# pole stands one pixel further left, in column 1. What is left of it?
#
# <details><summary>Answer</summary>Columns 0 and 2 are now -1 and -1, and after ReLU nothing: the pole is gone. What
# a strided layer sees of a thin thing depends on whether it stands in an even or an odd column.</details>
#
# $$ \text{out}[v, u] = \sum_{n=0}^{2} \sum_{m=0}^{2} \text{kernel}[n, m]\;
#    \text{in}[\text{stride}\, v + \text{rate}\, (n - 1),\; \text{stride}\, u + \text{rate}\, (m - 1)] $$


# %%
def convolve(image, kernel, stride=1, rate=1):
    """3x3 convolution of one channel; outside the image everything is zero."""
    h, w = image.shape
    padded = np.pad(image, rate)
    out = np.zeros((-(-h // stride), -(-w // stride)))
    for v, u in np.ndindex(out.shape):
        for n, m in np.ndindex(3, 3):
            out[v, u] += kernel[n, m] * padded[stride * v + rate * n, stride * u + rate * m]
    return out


rng = np.random.default_rng(0)
image, kernel = rng.normal(size=(9, 12)), rng.normal(size=(3, 3))
for stride, rate in ((1, 1), (2, 1), (1, 2), (3, 2)):
    by_torch = F.conv2d(to_torch(image), to_torch(kernel), stride=stride, padding=rate, dilation=rate)
    np.testing.assert_allclose(convolve(image, kernel, stride, rate), by_torch[0, 0], atol=1e-12)

row, thin = np.array([[0.0, 0, 1, 0, 0, 1, 1, 0]]), np.zeros((3, 3))
thin[1] = -1, 2, -1
moved = np.array([[0.0, 1, 0, 0, 0, 1, 1, 0]])
print("stride 1:", convolve(row, thin)[0], "\nstride 2:", convolve(row, thin, stride=2)[0])
print("stride 2, the pole one pixel to the left:", convolve(moved, thin, stride=2)[0])

# %% [markdown]
# The rate comes later; with rate 1 the kernel's weights are neighbours. A layer with many channels has a kernel for
# each pair of input and output channel, and each output channel sums over all inputs: from 16 to 32 channels that
# makes 9 · 16 · 32 weights and 32 constants (biases), 4640 parameters.
#
# The same on the drive, with a 3x3 kernel that has our row three times:

# %%
grey = images[8].mean(axis=-1) / 255
answer = F.conv2d(to_torch(grey), to_torch([[-1, 2, -1]] * 3), padding=1)[0, 0]
fig, axes = plt.subplots(1, 2, figsize=(6.5, 2.6), layout="constrained")
draw_image(grey[:, 150:270], ax=axes[0], cmap="gray").set_title("part of frame 8, grey")
plotting.image_values(answer[:, 150:270], "answer", ax=axes[1], cmap="PuOr_r", vmin=-1, vmax=1)
axes[1].set_title("thin: bright orange, dark violet")
plt.show()

# %% [markdown]
# Such a kernel finds the poles; it also finds window frames, slats of the fence and lane marks. Nine pixels can't
# tell which is which. The network has to look further.
#
# ### How far does a pixel see?
#
# One 3x3 convolution sees 3 pixels a side. A second one on top of it sees 5, a third 7: two more for each layer. Now
# halve after the first: from then on neighbours in the map are 2 pixels of the image apart, *jump* 2, and each layer
# adds 2 · 2 pixels. By hand:
#
# | layer | kernel | stride | rate | adds (kernel - 1) · rate · jump | field | jump after |
# |---|---|---|---|---|---|---|
# | convolution | 3 | 1 | 1 | 2 · 1 · 1 = 2 | 1 + 2 = 3 | 1 |
# | halving, 2x2 | 2 | 2 | 1 | 1 · 1 · 1 = 1 | 4 | 2 |
# | convolution | 3 | 1 | 1 | 2 · 1 · 2 = 4 | 8 | 2 |
# | convolution of rate 2 | 3 | 1 | 2 | 2 · 2 · 2 = 8 | 16 | 2 |
#
# **Predict before you run.** How many 3x3 convolutions does it take to see 128 pixels, if nothing is ever halved? And
# if the map is halved after every second one?
#
# <details><summary>Answer</summary>1 + 2 · 64 = 129: sixty-four layers, all of them at full size. With halving: ten,
# and those at the bottom cost next to nothing, since a map of a sixteenth of the height and of the width has 256
# times fewer pixels.</details>
#
# $$ \text{field} \leftarrow \text{field} + (\text{kernel} - 1) \cdot \text{rate} \cdot \text{jump}, \qquad
#    \text{jump} \leftarrow \text{jump} \cdot \text{stride} $$


# %% tags=["receptive-field"]
CONV, HALVE, DOUBLE = (3, 1, 1), (2, 2, 1), (1, 1 / 2, 1)  # kernel, stride, rate


def receptive_field(layers):
    """Return how many pixels a side one output sees, and how many pixels apart two outputs lie."""
    field, jump = 1, 1
    for kernel, stride, rate in layers:
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field, jump


def pixels_that_count(layers, size=400):
    """Ask PyTorch: by how many pixels of a row does the middle output have a derivative?"""
    x = row = torch.zeros(1, 1, size, requires_grad=True)
    for kernel, stride, rate in layers:
        x = F.conv1d(x, torch.ones(1, 1, kernel), stride=stride, dilation=rate)
    x[0, 0, x.shape[-1] // 2].backward()
    return int(row.grad.count_nonzero())


# %%
by_hand = [CONV, HALVE, CONV, (3, 1, 2)]
assert receptive_field(by_hand) == (pixels_that_count(by_hand), 2) == (16, 2)
halving = ([CONV, CONV, HALVE] * 5)[:14]  # ten convolutions, four halvings
assert receptive_field(halving)[0] == pixels_that_count(halving)
print("64 layers, no halving:", receptive_field([CONV] * 64)[0], "pixels;  10 layers:", receptive_field(halving)[0])

# %% [markdown]
# (`DOUBLE` is for later: a map that is doubled on the way up has half the jump.) So that is why networks go down:
# halving is the cheap way to see far.
#
# ### What is lost
#
# There are three usual ways to halve. *Max-pooling* takes the largest of each 2x2 window, *average pooling* their
# mean, *stride 2* every second output. Take a row of 16 pixels with a pole of 1 in column 8, and halve it twice.
#
# **Predict before you run.** Four numbers are left. Which, for each of the three? And for a pole in column 9, 10, 11?
#
# <details><summary>Answer</summary>Max: 0 0 1 0, for all four columns; the place is gone. Average: 0 0 ¼ 0, for all
# four; place and strength are gone. Stride: 0 0 1 0 for column 8, and nothing at all for the three others.</details>

# %%
for column in (8, 9, 10, 11):
    row = torch.eye(16)[column].view(1, 1, 16)
    by_max = F.max_pool1d(F.max_pool1d(row, 2), 2)
    by_mean = F.avg_pool1d(F.avg_pool1d(row, 2), 2)
    print(f"column {column}: max {by_max[0, 0].numpy()}, mean {by_mean[0, 0].numpy()}, stride {row[0, 0, ::4].numpy()}")

# %% [markdown]
# Max-pooling is the one that keeps *bright* thin things alive. (All poles of these toys are bright before a dark
# ground; the exercise has a dark one.) It forgets one bit of *where* across and one down at each halving: after four,
# 16 columns look alike. The question of this lecture is how to get those bits back.
#
# ## SegNet: remember where the maximum was
#
# Pool this 4x4 map by windows of 2x2, and note for each maximum where it was, counting the map row by row from 0:
#
# ```
#  1  0 | 0  2                              0  0  0  2
#  0  3 | 0  0      maxima     indices      0  3  0  0
#  -----+-----       3  2        5   3      0  0  4  0
#  0  0 | 4  0       5  4       12  10      5  0  0  0
#  5  0 | 0  0
# ```
#
# On the way up, each maximum goes back to where it came from; the rest of the map is zero. That's all: **unpooling**.
#
# **Predict before you run.** What happened to the 1 in the corner? How many numbers of an unpooled 96 x 320 map are
# zero, at least?
#
# <details><summary>Answer</summary>It was second in its window: lost. Three in four are zero, 23,040 of 30,720; the
# convolutions that follow fill the holes.</details>
#
# $$ \text{index}[v, u] = \underset{\text{window } (v, u)}{\operatorname{arg\,max}}\; \text{in}, \qquad
#    \text{out}[\,\text{index}[v, u]\,] = \text{pooled}[v, u], \quad 0 \text{ elsewhere} $$


# %% tags=["unpool"]
def max_pool(image):
    """Return the maxima of 2x2 windows, and where in the map each was: row * width + column."""
    h, w = image.shape
    pooled, indices = np.zeros((h // 2, w // 2)), np.zeros((h // 2, w // 2), int)
    for v, u in np.ndindex(pooled.shape):
        window = image[2 * v : 2 * v + 2, 2 * u : 2 * u + 2]
        n, m = np.unravel_index(window.argmax(), (2, 2))
        pooled[v, u], indices[v, u] = window[n, m], (2 * v + n) * w + 2 * u + m
    return pooled, indices


def unpool(pooled, indices, shape):
    """Put each maximum back where it was."""
    image = np.zeros(shape)
    image.flat[indices.ravel()] = pooled.ravel()
    return image


# %%
by_hand = np.array([[1.0, 0, 0, 2], [0, 3, 0, 0], [0, 0, 4, 0], [5, 0, 0, 0]])
for image in (by_hand, rng.normal(size=(6, 10))):
    pooled, indices = max_pool(image)
    values, places = F.max_pool2d(to_torch(image), 2, return_indices=True)
    np.testing.assert_allclose(pooled, values[0, 0])
    np.testing.assert_array_equal(indices, places[0, 0])
    np.testing.assert_allclose(unpool(pooled, indices, image.shape), F.max_unpool2d(values, places, 2)[0, 0])
print("indices of the 4x4 map:", max_pool(by_hand)[1].tolist())

# %% [markdown]
# The indices cost two bits a window, no weights, and bring back exactly what max-pooling forgot. Note what they don't
# bring back: whatever was second.
#
# The same on the drive: two channels of the trained SegNet before its first pooling, at the warning sign of frame 0.
# Pooled once, then brought back in two ways.

# %%
with torch.inference_mode():
    segnet = nets["segnet"]
    features = segnet.conv_deconv.encoder[0]((as_input(images[:1]) - segnet.mean) / segnet.std)
fig, axes = plt.subplots(2, 4, figsize=(9, 4.6), layout="constrained")
sign, post = (5, slice(16, 44), slice(214, 242)), (13, slice(44, 72), slice(214, 242))  # channel, rows, columns
for row, (number, rows, columns) in zip(axes, (sign, post), strict=True):
    channel = features[:, [number]]
    pooled, indices = F.max_pool2d(channel, 2, return_indices=True)
    ways = (channel, F.interpolate(pooled, scale_factor=2), F.max_unpool2d(pooled, indices, 2))
    draw_image(images[0][rows, columns], ax=row[0])
    for ax, way in zip(row[1:], ways, strict=True):
        draw_image(way[0, 0, rows, columns], ax=ax, cmap="magma")
for ax, name in zip(
    axes[0], ("part of frame 0", "before pooling", "back, each to all four", "back, by the indices"), strict=True
):
    ax.set_title(name)
plt.show()

# %% [markdown]
# Above, a channel that has learnt to answer to the rim of the sign; below, one that answers to upright edges, as
# those of the post. Given back to all four pixels of a window (third column), lines become two pixels wide and jump
# in steps of two. By the indices each value lies where it lay, with holes between: a dotted line, which the decoder's
# convolutions have to close.
#
# ## FCN: add what finer maps say
#
# FCN keeps no indices. It scores the classes at three depths, enlarges the coarse scores by bilinear interpolation,
# and *adds* the finer ones: a **skip**. By hand, on a row of eight pixels; scores of pole against the rest.
#
# ```
# coarse, each for two pixels    -3        -3         3        -3
# enlarged                       -3   -3   -3  -1.5  1.5  1.5 -1.5  -3     something is there, some two pixels wide
# fine                           -2    2   -2   -2   -2    2   -2   -2     two thin lines: a crack in a wall, a pole
# sum                            -5   -1   -5  -3.5 -0.5  3.5 -3.5  -5     one pole, one pixel wide
# ```
#
# Coarse knows *what*, fine knows *where*; neither is right, and their sum is. To enlarge a row, remember what a cell
# of a pooled map covers: two pixels, so that its value belongs *between* them. The first row's values sit at columns
# 0.5, 2.5, 4.5, 6.5, and column 3 is a quarter of the way from 2.5 to 4.5: -3 + 6/4 = -1.5.
#
# **Predict before you run.** DeepLab's map isn't pooled but strided: cell $i$ lies *on* pixel 8 $i$. Enlarge such a
# map as if its cells covered pixels 8 $i$ to 8 $i$ + 7: by how much is every pole off?
#
# <details><summary>Answer</summary>The middle of pixels 0 to 7 is 3.5. So everything lands 3.5 pixels too far right,
# and as far too low: nearly half a cell. It is the mistake of lecture 06, where it was half a pixel.</details>


# %% tags=["skips"]
def enlarge_row(scores, factor):
    """Cell i covers pixels factor i .. factor (i + 1) - 1; beyond the outermost middles the row stays constant."""
    middle = (np.arange(len(scores)) + 0.5) * factor - 0.5
    return np.interp(np.arange(len(scores) * factor), middle, scores)


def interpolate_row(scores, stride, width):
    """Cell i lies on pixel stride i."""
    return np.interp(np.arange(width), stride * np.arange(len(scores)), scores)


coarse, fine = np.array([-3.0, -3, 3, -3]), np.array([-2.0, 2, -2, -2, -2, 2, -2, -2])
for values, factor in ((coarse, 2), (rng.normal(size=5), 8)):
    width = factor * len(values)
    by_package = enlarge(to_torch(values), factor, (1, width))[0, 0, 0]
    np.testing.assert_allclose(enlarge_row(values, factor), by_package)
    by_package = interpolate(to_torch(values), factor, (1, width))[0, 0, 0]
    np.testing.assert_allclose(interpolate_row(values, factor, width), by_package)
print("enlarged:", enlarge_row(coarse, 2), "\nsum:     ", enlarge_row(coarse, 2) + fine)

# %% [markdown]
# The same on the drive: the trained FCN's lead of signage at 1/32 of the image's size, then with the scores of pool4
# added at 1/16, of pool3 at 1/8, and enlarged to the image.

# %%
fcn = nets["fcn"]
with torch.inference_mode():
    _, _, pool3, pool4, pool5 = fcn.backbone((as_input(images[8:9]) - fcn.mean) / fcn.std)
    at_32 = fcn.score_conv7(fcn.conv7(fcn.conv6(pool5)))
    at_16 = enlarge(at_32, 2, pool4.shape[2:]) + fcn.score_pool4(pool4)
    at_8 = enlarge(at_16, 2, pool3.shape[2:]) + fcn.score_pool3(pool3)
    s = enlarge(at_8, 8, SIZE)
    torch.testing.assert_close(s, fcn(as_input(images[8:9])))
names = ("1/32", "1/16, pool4 added", "1/8, pool3 added", "enlarged to the image")
fig, axes = plt.subplots(2, 2, figsize=(10, 3.6), layout="constrained")
for ax, name, part in zip(axes.flat, names, (at_32, at_16, at_8, s), strict=True):
    draw_image(lead_of(POLE, part[0]), ax=ax, cmap="PuOr_r", vmin=-4, vmax=4).set_title(name)
fig.colorbar(axes[0, 0].images[0], ax=axes, label="lead of signage", fraction=0.02)
plt.show()

# %% [markdown]
# At 1/32 signage leads nowhere. With pool4 two patches are barely ahead; pool3 breaks them up into a few small ones,
# one of them a distant street lamp (upper middle), another at the foot of the lamp post and the sign. But the finest
# map has cells of 8 pixels, and the post is three pixels wide. A skip gives back what its finest map holds, and no
# more.
#
# ## DeepLab: don't halve, spread the kernel
#
# Halving has two effects: a map with fewer pixels, and kernels that see further. Only the second is wanted. So leave
# the stride out, and give the kernels *holes* instead (French: *à trous*): **rate** 2 puts zeros between the weights.
# By hand, a row with one pole, and the kernel 1 2 3:
#
# ```
# row                   0    0    0    1    0    0    0    0
# rate 1                0    0    3    2    1    0    0    0       sees 3 pixels
# rate 2                0    3    0    2    0    1    0    0       sees 5, with the same three weights
# ```
#
# **Predict before you run.** Halve the row by stride 2, columns 0, 2, 4, 6, then convolve with rate 1. Which numbers
# of a convolution with rate 2 on the *whole* row are those?
#
# <details><summary>Answer</summary>Those of columns 0, 2, 4, 6, exactly. The rate-2 kernel reads every second pixel,
# starting at an even one reads even ones only: just what the strided row holds. Nothing changes but that the answers
# in between are there too. So a network trained with strides can be made dense without new weights.</details>
#
# $$ \text{kernel} \ast_{\text{rate } 2} \text{in}\;\Big|_{\text{every second}} \;=\;
#    \text{kernel} \ast_{\text{rate } 1} \left(\text{in}\;\Big|_{\text{every second}}\right) $$

# %% tags=["atrous"]
row, kernel = np.eye(8)[[3]], np.zeros((3, 3))
kernel[1] = 1, 2, 3
print("rate 1:", convolve(row, kernel)[0], "\nrate 2:", convolve(row, kernel, rate=2)[0])
image, kernel = rng.normal(size=(16, 24)), rng.normal(size=(3, 3))
strided = convolve(image[::2, ::2], kernel)
np.testing.assert_allclose(convolve(image, kernel, rate=2)[::2, ::2], strided)

# %% [markdown]
# Full resolution, a wide field, no more weights. The price is computing time: each map keeps all its pixels. So
# DeepLab compromises: it halves three times and goes atrous for the rest, and its scores have 1/8 of the image's
# height and width, enlarged without any skip.
#
# The same on the drive. At its end DeepLab looks at one map with four kernels side by side, of rates 2, 4, 6 and 8 in
# the compact network, and sums their scores: *atrous spatial pyramid pooling*.

# %%
deeplab = nets["deeplab"]
with torch.inference_mode():
    features = deeplab.backbone((as_input(images[8:9]) - deeplab.mean) / deeplab.std)
    parts = [classify(features) for classify in deeplab.aspp]
    summed = deeplab.scale * sum(parts)
    torch.testing.assert_close(interpolate(summed, 8, SIZE), deeplab(as_input(images[8:9])))
fig, axes = plt.subplots(1, 5, figsize=(11, 1.3), layout="constrained")
for ax, name, part in zip(axes, ("rate 2", "rate 4", "rate 6", "rate 8", "sum"), [*parts, summed], strict=True):
    draw_image(KITTI_14.colours(part[0].argmax(dim=0)), ax=ax).set_title(name)
plt.show()

# %% [markdown]
# The class with the largest score in each cell of 8 pixels; colours as above. No rate by itself is right: the
# pictures of single rates show signs, fences and trees where there are none. Training asked only that the sum be right,
# so constants may move from one addend to another, and the largest score of a single one means nothing.
#
# ### Gridding
#
# There is a second price. Three layers of rate 2, one on top of the other: the field is 13 pixels. **Predict before
# you run.** Of these 13, how many count?
#
# <details><summary>Answer</summary>Seven. An output in an even column reads even columns, which read even columns,
# and so on: its neighbours to the left and right are never looked at. With rates 1, 2, 4 all 15 pixels of the field
# count.</details>

# %%
fig, axes = plt.subplots(1, 3, figsize=(9, 2.8), layout="constrained")
for ax, rates in zip(axes, ((1, 1, 1), (2, 2, 2), (1, 2, 4)), strict=True):
    seen = np.eye(19)[[9]].T @ np.eye(19)[[9]]
    for rate in rates:
        seen = convolve(seen, np.ones((3, 3)), rate=rate)
    across = np.count_nonzero(seen[9])
    ax.imshow(np.where(seen > 0, seen, np.nan), cmap="viridis", extent=(-9.5, 9.5, 9.5, -9.5))
    ax.set(title=f"rates {rates}: {across} columns count", xlabel="columns to the right [pixels]")
axes[0].set_ylabel("rows down [pixels]")
plt.show()

# %% [markdown]
# The pixels that the output in the middle depends on, the brighter the more paths lead there; white ones never count.
# In the middle picture three pixels of four are white, however many such layers follow.
#
# ## One pole, six ways back
#
# Now all of them on one picture, nothing learnt: halve it twice, and come back to full size.
#
# | way | down | up |
# |---|---|---|
# | nearest | max-pooling, twice | each value to its 16 pixels |
# | bilinear | max-pooling | interpolated |
# | **indices** | max-pooling | unpooling |
# | **skips** | max-pooling | interpolated, the mean with the finer maps |
# | strided | kernel (1 2 1)/4 across and down, stride 2, twice | interpolated |
# | **atrous** | the same two kernels without stride, the second with rate 2 | |
#
# **Predict before you run.** A bright pole, 1 on a ground of 0, one pixel wide. Which ways say in which column it
# stands? Which keep it one pixel wide? For each way: the brightest column, and the number of columns at least half as
# bright.
#
# <details><summary>Answer</summary>Indices, skips and atrous find the column, all four times; nearest and bilinear
# make one picture of the four; strided is right in column 8, and in column 10 only because its top is flat from 8 to
# 12, with 10 as the mean. Only the indices keep the width: skips make it two, atrous five.</details>


# %%
def poles(column, width=1, height=16):
    """(16, 24): a dark picture with a bright pole."""
    image = np.zeros((height, 24))
    image[2:14, column : column + width] = 1
    return image


print("pole in column  ", *(f"{way:>10}" for way in MECHANISMS))
for column in (8, 9, 10, 11):
    found = [place_and_width(apply_mechanism(poles(column), way).max(axis=0)) for way in MECHANISMS]
    print(f"{column:14}  ", *(f"{place:5g} / {width:2d}" for place, width in found))

# %% [markdown]
# Play with it. The upper row is what comes in and what comes back; the bars are its brightest row.


# %% tags=["nbval-ignore-output"]
def draw_ways(column, width):
    """Draw a pole, and what each way makes of it."""
    image = poles(column, width)
    _, axes = plt.subplots(2, 7, figsize=(11, 2.6), layout="constrained", sharex=True, height_ratios=(1, 0.8))
    pictures = {"the pole": image, **{way: apply_mechanism(image, way) for way in MECHANISMS}}
    for (above, below), (name, picture) in zip(axes.T, pictures.items(), strict=True):
        above.imshow(picture, cmap="magma", vmin=0, vmax=1)
        above.set(title=name, yticks=[])
        below.bar(range(24), picture.max(axis=0), width=1, color="0.3")
        below.axvspan(column - 0.5, column + width - 0.5, color="tab:orange", alpha=0.4, linewidth=0)
        below.set(ylim=(0, 1.05), xlabel="column", yticks=[0, 0.5, 1] if below is axes[1, 0] else [])
    axes[1, 0].set_ylabel("brightness")
    plt.show()


_ = interact(draw_ways, column=IntSlider(9, 4, 16), width=IntSlider(1, 1, 6))

# %% [markdown]
# Without a kernel: a pole of one pixel, in columns 9 and 10, and one of four pixels. The orange band is where it
# truly stands.

# %%
for column, width in ((9, 1), (10, 1), (9, 4)):
    draw_ways(column, width)

# %% [markdown]
# **Indices** are sharp, in the right place, and full of holes: a dotted line. **Skips** are right and have a foot of
# what the coarse maps think. **Strided** is blurred, and how bright it is depends on where the pole stands (compare
# columns 9 and 10). **Atrous** is as blurred, but the same wherever the pole stands: shift the pole, and the answer
# shifts. A pole of four pixels comes back in its place or nearly, whichever way it went, and strided and atrous give it
# back much brighter; but nearest makes it eight wide, and the indices keep two dotted columns of it. The trouble is
# with thin things.
#
# ## The same, learnt
#
# Do learnt weights repair what the mechanism lost? Six networks of seven 3x3 convolutions, 3242 weights each, that
# start from the same numbers and see the same 1200 pictures: a pole one or two pixels wide beside a wall of the same
# brightness, in noise. The wall is 6 to 10 pixels wide, so nobody can tell the two apart who doesn't look that far.
# The networks differ in one of the six mechanisms, and in nothing else. (Here skips add whole maps; FCN adds scores.)
#
# **Predict before you run.** Order the six by how well they draw poles that they haven't seen.

# %% tags=["nbval-ignore-output"]
torch.set_num_threads(1)  # on maps this small, two threads wait for each other; and the results stay the same
unseen, poles_of = draw_poles(200, seed=12345)
drawn = {"image": unseen[:, 0], "truth": poles_of}
print("              IoU [%]   rows missed [%]   width (truth) [pixels]   beside by [pixels]")
for way in MECHANISMS:
    drawn[way] = train_pole_net(way)(unseen).detach().argmax(dim=1)
    got = score_poles(drawn[way], poles_of)
    width = f"{got.width:.1f} ({got.true_width:.1f})"
    print(f"{way:<11} {100 * got.iou:8.0f} {100 * got.missed:15.0f} {width:>23} {got.offset:18.2f}")

# %%
fig, axes = plt.subplots(3, 8, figsize=(11, 4.4), layout="constrained")
for row, k in zip(axes, (1, 2, 4), strict=True):
    for ax, (name, pictures) in zip(row, drawn.items(), strict=True):
        draw_image(pictures[k], ax=ax, cmap="gray" if name == "image" else "magma")
for ax, name in zip(axes[0], drawn, strict=True):
    ax.set_title(name)
plt.show()

# %% [markdown]
# Each row is one unseen picture; the thin bright thing in the second column is the pole, and the other bright bar of
# the image is the wall. Numbers vary a little from machine to machine. With five seeds the order of the groups was
# always the same: strided (IoU 30 to 41 %), nearest and bilinear (47 to 67 %), indices (68 to 79 %), and ahead atrous
# (86 to 93 %) and skips (92 to 94 %), of which now one won, now the other.
#
# Two things for the sake of honesty. Atrous pays: it computes nearly three times as much as the networks that pool,
# and eight times as much as strided. And training closes a part of the gap: with 250 steps instead of 150, indices
# come to 83 to 89 % and bilinear to 62 to 78 %. Strided is the exception: it stays below 50 %
# with ten times the steps. A mechanism decides what needn't be learnt, and sometimes what can't be.

# %% [markdown]
# ## The package's networks
#
# Each of the three, and U-Net as a fourth, comes in the published size, `paper`, and narrow enough for two cores,
# `compact`. What tells them apart has stayed:
#
# | | on the way down | on the way up | *where* comes from |
# |---|---|---|---|
# | SegNet | max-pooling, four times | unpooling by indices, then as many convolutions as down | indices |
# | FCN-8s | VGG16: max-pooling, five times | bilinear, 2x, 2x, 8x | sums with scores of two finer depths |
# | DeepLab v2 | ResNet: halves three times, then atrous | bilinear, 8x | a map that never got small |
# | U-Net | max-pooling, four times | learnt doubling | whole maps of the encoder, side by side with its own |
#
# **Predict before you run.** The four compact networks have 0.2 to 0.5 million weights each. Which of them sees
# farthest? And which computes its scores on the finest map?
#
# <details><summary>Answer</summary>FCN, with a 7x7 kernel at 1/32 of the size: 404 pixels, more than the image has.
# DeepLab's atrous layers see nearly as far. SegNet and U-Net score at every pixel, FCN and DeepLab at every
# eighth.</details>

# %%
HALVING_CONV, ATROUS = (3, 2, 1), [(3, 1, 2)] * 4 + [(3, 1, 4), (3, 1, 8)]
VGG16 = [CONV, CONV, HALVE] * 2 + [CONV, CONV, CONV, HALVE] * 3
down, up = [HALVE, CONV, CONV], [DOUBLE, CONV, CONV]
CHAINS = {
    "segnet": [CONV, CONV, *[HALVE, CONV] * 2, *down, HALVE, *up, *[DOUBLE, CONV] * 2, *up],
    "fcn": [*VGG16, (7, 1, 1)],
    "deeplab": [(7, 2, 1), HALVING_CONV, CONV, CONV, HALVING_CONV, CONV, CONV, *ATROUS],
    "unet": [CONV, CONV, *down * 4, *up * 4],
}
EVERY = {"segnet": 1, "fcn": 8, "deeplab": 8, "unet": 1}


def parameters(name, preset):
    """Count weights and biases; PyTorch's "meta" device gives layers shapes without memory."""
    with torch.device("meta"):
        return sum(p.numel() for p in build_segmenter(name, len(KITTI_14), preset).parameters())


print("                parameters   (paper)   field [pixels]   a score every ... pixels")
for name in NAMES:
    sizes = f"{parameters(name, 'compact'):11,} {parameters(name, 'paper'):12,}"
    print(f"{NAMES[name]:<11} {sizes} {receptive_field(CHAINS[name])[0]:12.0f} {EVERY[name]:16}")

# %% [markdown]
# The field is what a pixel *can* see. What it does look at is another question, and the gradient answers it: by how
# much does the score of signage at one pixel, on the lamp post of frame 8 (cross), change with each pixel of the
# image? (The pictures show the square root, so that small slopes can be seen too.)

# %%
fig, axes = plt.subplots(3, 1, figsize=(4.7, 4.8), layout="compressed")
for ax, name in zip(axes, TRAINED, strict=True):
    x = as_input(images[8:9]).requires_grad_()
    nets[name](x)[0, POLE, 40, 198].backward()
    slope = x.grad[0].abs().sum(dim=0)
    across = np.flatnonzero(slope.sum(dim=0) > 0)
    share = slope.sum(dim=0).cumsum(0) / slope.sum()
    half = np.searchsorted(share, [0.25, 0.75])
    assert np.ptp(across) < receptive_field(CHAINS[name])[0]
    draw_image((slope / slope.max()).sqrt().mul(15).round(), ax=ax, cmap="magma")
    ax.plot(198, 40, "x", color="cyan")
    for column in half:
        ax.axvline(column, color="white", linewidth=1, linestyle=":")
    ax.set_title(f"{NAMES[name]}: half within {np.ptp(half)} columns (dotted)")
plt.show()

# %% [markdown]
# A field says how far a score can see, not how far it looks. SegNet's ends where you computed it, 56 pixels to either
# side, and half of what moves its score lies much nearer, between the dotted lines. FCN and DeepLab could see the whole
# width, and half of what moves theirs lies within a fifth of it. DeepLab's picture is made of blocks of 8 pixels, the
# cells of its map: one cell may count a lot and its neighbour hardly at all, for kernels with holes leap from cell to
# cell.
#
# ### Before the first label: ImageNet
#
# The paper doesn't start from random weights. It takes the encoders' weights from a network that has learnt to name
# what is on 1.3 million photographs (ImageNet), so that 142 labelled frames only have to teach the rest. A 3x3 layer
# from $a$ to $b$ channels has $9ab + b$ numbers. VGG16's thirteen convolutions go from 3 channels to 64, 64, 128,
# 128, 256, 256, 256, and six times 512. By hand, the first two: 9 · 3 · 64 + 64 = 1,792 and 9 · 64 · 64 + 64 =
# 36,928.
#
# **Predict before you run.** Which weighs more: the first ten layers, or the last three?
#
# <details><summary>Answer</summary>The last three weigh 7,079,424, the ten before them 7,635,264: about the same.
# Weights are where channels are many, time is where pixels are many.</details>

# %%
channels = [3, 64, 64, 128, 128, 256, 256, 256] + 6 * [512]
by_hand = [9 * a * b + b for a, b in pairwise(channels)]
with torch.device("meta"):
    wanted = imagenet_tensors(build_segmenter("segnet", n_classes=14, preset="paper"))
assert sum(by_hand) == sum(tensor.numel() for tensor in wanted.values()) == 14_714_688
print(f"{sum(by_hand):,} numbers, in the file called", ", ".join(list(wanted)[:3]), "...")

# %% [markdown]
# `load_imagenet(segmenter, path)` fills these from a file on your disk with torchvision's names, and refuses a file
# in which a name is missing or a shape differs. The project ships no such file: the compact networks start at random,
# and their two training stages stand in for it.
#
# Starting at random needs one more idea. **Batch normalisation**: of each channel subtract the mean and divide by the
# standard deviation, over all pixels of the batch; then let the network choose a new mean and scale. By hand: 1, 3,
# 5, 7 has mean 4 and variance 5, so -3/√5, -1/√5, 1/√5, 3/√5. Every layer then gets inputs of one size, however the
# layers before it change. After training, running means take the place of the batch's, so that an image's scores
# don't depend on what else is in its batch. VGG16 has none of it, FCN's published size neither; SegNet has it after
# each convolution.

# %%
values = torch.tensor([1.0, 3, 5, 7]).view(1, 1, 2, 2)
normalised = F.batch_norm(values, None, None, training=True, eps=1e-12)
np.testing.assert_allclose(normalised.flatten(), np.array([-3, -1, 1, 3]) / np.sqrt(5), rtol=1e-6)
both, alone = as_input(images[[8, 16]]), as_input(images[[8]])
with torch.inference_mode():
    torch.testing.assert_close(segnet(both)[:1], segnet(alone), atol=1e-3, rtol=1e-3)

# %% [markdown]
# ### On the drive
#
# All twenty frames of the sample drive; the networks have learnt from minikitti's 142 training frames, 2000 steps of
# labelled images. **Predict before you run.** Which network draws thin posts best? And how far apart are the three in
# pixel accuracy, the share of all pixels called right?
#
# <details><summary>Answer</summary>None draws a post: where one stands, there is a yellow patch at best. And a few
# points of a hundred lie between the best and the last. Look, and read on.</details>

# %%
called, matrices = {}, {}
for name in TRAINED:
    with torch.inference_mode():
        called[name] = nets[name](as_input(images)).argmax(dim=1).numpy()
    matrices[name] = confusion_matrix(truths, called[name], len(KITTI_14))
fig, axes = plt.subplots(4, 2, figsize=(9.8, 6.6), layout="compressed")
for column, k in enumerate((0, 8)):
    draw_image(KITTI_14.colours(truths[k]), ax=axes[0, column]).set_title(f"truth, frame {k}")
    for ax, name in zip(axes[1:, column], TRAINED, strict=True):
        draw_image(KITTI_14.colours(called[name][k]), ax=ax).set_title(NAMES[name])
plotting.class_legend(axes[3, 0], KITTI_14, truths, loc="upper left", bbox_to_anchor=(0, -0.05), ncols=5)
plt.show()


# %%
def of_class(c, m):
    """Found: of the true pixels, called so. Right: of those called so, true. Area: called so, against true."""
    return m[c, c] / m[c].sum(), m[c, c] / m[:, c].sum(), m[:, c].sum() / m[c].sum()


print(f"{'':29}signage               pedestrian")
print("[%]         pixels  classes   found  right  area    found  right  area")
for name in TRAINED:
    m = matrices[name]
    numbers = (pixel_accuracy(m), class_accuracy(m), *of_class(POLE, m), *of_class(PEDESTRIAN, m))
    print(f"{NAMES[name]:<11}" + "{:7.0f} {:8.0f} {:7.0f} {:6.0f} {:5.0f} {:8.0f} {:6.0f} {:5.0f}".format(
        *(100 * number for number in numbers)))  # fmt: skip
print(
    "pixels that are signage or pedestrian: {:.1f}, {:.1f}".format(*100 * m.sum(axis=1)[[POLE, PEDESTRIAN]] / m.sum())
)

# %% [markdown]
# The first two columns are pixel accuracy and class accuracy, the mean over classes. A few points lie between the
# three, on one street, with one seed each: no ground to rank them. The paper's first claim, SegNet before FCN before
# DeepLab when images are few, is put to the test in lecture [12](12_experiments.ipynb).
#
# The pictures differ more than the numbers. SegNet's borders are detailed and ragged, with specks; FCN and DeepLab,
# which score every eighth pixel, draw smooth blobs. Sharp isn't right, though: of the pixels of signage
# SegNet and DeepLab find less than a half and FCN about a half, and most of what they call signage is something else.
# Of pedestrians more is found, at a price: several times as many pixels are called pedestrian as there are (area).
#
# So where are the three mechanisms, if no network draws the post? Above, they decided how well a task was solved that
# had nothing but poles. On this drive two pixels in a hundred are signage and three in a thousand pedestrian. The
# networks have seen only 142 frames, and they have a dozen other things to learn. Keeping *where* is necessary; it
# isn't enough.

# %% [markdown]
# ## Where this breaks
#
# **A pole between two maxima.** An index can only say where the *largest* value of a window was. Give the pole a
# brighter wall in the same window; and give a smooth slope, which has no thin thing in it, to the same two lines of
# code.

# %%
pole = np.zeros((8, 8))
pole[:, 5] = 1
wall, slope = pole.copy(), np.tile(np.arange(8) / 4, (8, 1))
wall[:, :5] = 2
fig, axes = plt.subplots(1, 6, figsize=(11, 2.2), layout="constrained")
for pair, name, image in zip(axes.reshape(3, 2), ("pole", "wall and pole", "slope"), (pole, wall, slope), strict=True):
    draw_image(image, ax=pair[0], cmap="magma", vmin=0, vmax=2).set_title(name)
    back = unpool(*max_pool(image), image.shape)
    draw_image(back, ax=pair[1], cmap="magma", vmin=0, vmax=2).set_title("there and back")
plt.show()

# %% [markdown]
# Left, the pole becomes a dotted line. In the middle it is gone: each of its windows has a brighter pixel. Right, a
# smooth slope comes back as dots on a lattice that isn't there in the world. It is the decoder's job to smooth it
# again. This lattice one kernel would close, 1 2 1 across and down; but in an image the dots lie elsewhere in each
# window, and no one kernel suits them all.
#
# **Checkerboards.** Instead of unpooling, a network may *learn* to double: a transposed convolution puts a copy of
# its kernel, times the value, at every second pixel, and adds up. By hand, a kernel of three ones and a row of ones:
# its odd pixels get two copies, the even ones one.

# %%
print("kernel of 3:", F.conv_transpose1d(torch.ones(1, 1, 5), torch.ones(1, 1, 3), stride=2)[0, 0].numpy())
print("kernel of 2:", F.conv_transpose1d(torch.ones(1, 1, 5), torch.ones(1, 1, 2), stride=2)[0, 0].numpy())
fig, axes = plt.subplots(1, 4, figsize=(9, 2.4), layout="constrained")
flat = torch.ones(1, 1, 9, 9)
up = build_segmenter("unet", n_classes=14).up[0]  # 2x2, stride 2, at its first random weights
features = torch.ones(1, up.in_channels, 9, 9)
with torch.no_grad():
    ways = {
        "kernel 3": F.conv_transpose2d(flat, torch.ones(1, 1, 3, 3), stride=2),
        "kernel 4": F.conv_transpose2d(flat, torch.ones(1, 1, 4, 4), stride=2),
        "kernel 2": F.conv_transpose2d(flat, torch.ones(1, 1, 2, 2), stride=2),
        "kernel 2, random": up(features)[:, :1],
    }
for ax, (name, picture) in zip(axes, ways.items(), strict=True):
    draw_image(picture[0, 0], ax=ax, cmap="viridis").set_title(name)
plt.show()

# %% [markdown]
# A flat map goes in, bright is large. With a kernel of 3 the pattern is in the arithmetic; 4 and 2, multiples of the
# stride, add up evenly (4 but for the border; 2 gives one value, so one colour). On the right, the four weights of a
# 2x2 kernel differ, as they do before and often after training: a checkerboard again. If a map of yours shows a
# pattern of a period of 2, 4 or 8 pixels, suspect the way up, not the street.
#
# **Another world.** The networks have seen simulated streets by daylight. Take the same twenty frames, and change
# what no human would stumble over.

# %%
changes = {
    "as it is": images,
    "darker, half": images // 2,
    "noise of 10 %": np.clip(images + rng.normal(0, 25, images.shape), 0, 255).astype(np.uint8),
    "red and blue swapped": images[..., ::-1].copy(),
    "upside down": images[:, ::-1].copy(),
}
print(f"pixel accuracy [%]     {'SegNet':>12} {'FCN-8s':>12} {'DeepLab v2':>12}")
for change, changed in changes.items():
    right = []
    for name in TRAINED:
        with torch.inference_mode():
            classes = nets[name](as_input(changed)).argmax(dim=1).numpy()
        expected = truths[:, ::-1] if change == "upside down" else truths
        right.append(pixel_accuracy(confusion_matrix(expected, classes, len(KITTI_14))))
    print(f"{change:<22}", *(f"{100 * share:12.0f}" for share in right))

# %% [markdown]
# Half the light costs FCN two points, SegNet seven and DeepLab eighteen: training varied brightness by a fifth only.
# Noise that a human hardly minds costs the two that pool maxima dearly, and DeepLab little. Its first layer sums over
# 7x7 pixels before anything else is done, while a maximum of noisy values is the noisiest; that may be why. Two colours
# swapped, a common bug (OpenCV reads blue first), cost more than half the light and raise no error. Upside down, the
# networks are worse than a program that calls everything vegetation (23 %): they know where sky and road *belong*, not
# only what they look like. Real images are further away than most of these: lecture 13.
#
# **Small classes.** Pixel accuracy doesn't see them. Take from SegNet all that it calls signage, pedestrian or
# bicycle, and let it say the second best:

# %%
small = [KITTI_14.index(name) for name in ("signage", "pedestrian", "bicycle")]
with torch.inference_mode():
    scores = nets["segnet"](as_input(images))
    scores[:, small] = -torch.inf
blind = confusion_matrix(truths, scores.argmax(dim=1).numpy(), len(KITTI_14))
for name, m in (("as trained", matrices["segnet"]), ("blind to small things", blind)):
    print(f"{name:<22} pixel accuracy {100 * pixel_accuracy(m):.0f} %   class accuracy {100 * class_accuracy(m):.0f} %")

# %% [markdown]
# Blind, the network gains in pixel accuracy, if little, for it calls fewer pixels pedestrian that are none, and loses
# a lot of class accuracy. By the first number alone you would choose the network that runs people over. That is why
# the paper gives both, and why the loss weighs classes by their frequency (lecture 08).
#
# ## In five lines
#
# 1. A network gives scores; soft-max and cross-entropy teach it, by probability minus truth; scores go to the planes.
# 2. To see far, halve: a layer adds (kernel - 1) · rate · jump to the field. What is lost is *where*, a bit a halving.
# 3. Indices put maxima back sharply and lose what was second; skips let a fine map say where, and need the fine map to
#    know something; atrous layers lose nothing, cost time, and leave gaps in what they see.
# 4. A strided or interpolated map makes thin things wide, faint, and dependent on where they stand.
# 5. Pixel accuracy doesn't see a pole. Ask for what is found, what is right, and how wide it is drawn.
#
# ## Further reading
#
# - Long, Shelhamer, Darrell, *Fully convolutional networks for semantic segmentation*, CVPR 2015: FCN and its skips.
# - Badrinarayanan, Kendall, Cipolla, *SegNet: a deep convolutional encoder-decoder architecture for image
#   segmentation*, PAMI 39(12), 2017: pooling indices.
# - Chen, Papandreou, Kokkinos, Murphy, Yuille, *DeepLab: semantic image segmentation with deep convolutional nets,
#   atrous convolution, and fully connected CRFs*, PAMI 40(4), 2018.
# - Ronneberger, Fischer, Brox, *U-Net: convolutional networks for biomedical image segmentation*, MICCAI 2015.
# - Odena, Dumoulin, Olah, *Deconvolution and checkerboard artifacts*, Distill 2016.
# - Wang, Chen, Yuan, Liu, Huang, Hou, Cottrell, *Understanding convolution for semantic segmentation*, WACV 2018:
#   gridding, and rates against it.
# - Luo, Li, Urtasun, Zemel, *Understanding the effective receptive field in deep convolutional neural networks*,
#   NIPS 2016: what a pixel can see, and what it looks at.
# - Ioffe, Szegedy, *Batch normalization*, ICML 2015. Simonyan, Zisserman, *Very deep convolutional networks for
#   large-scale image recognition*, ICLR 2015: VGG16. He, Zhang, Ren, Sun, *Deep residual learning for image
#   recognition*, CVPR 2016: ResNet.
#
# ## Exercise
#
# [Exercise 07](exercises/07_segmentation.ipynb): the field of a chain and where it looks, pooling with overlap and the
# way back, a whole layer with holes, a skip, the loss and its gradient, and one question. Next: lecture 08, from planes
# to the semantic grid.
