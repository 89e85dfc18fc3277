# %% [markdown]
# # What trained networks do: sizes, fields, failures
#
# **In one sentence.** Lecture 07 built the mechanisms; here are the networks that use them: how large they are, how far
# they can see (their *receptive field*, below just *field*) and how far they look, how well they label the drive, and
# which changes of an image they don't survive.
#
# **You will be able to**
# - read a network's table: parameters, field, and how fine its scores are;
# - measure with a gradient where a score looks;
# - say what weights from ImageNet and batch normalisation are for;
# - read accuracy by class: found, right, and area;
# - recognise patterns that are made by the network and not by the world.
#
# **Prerequisites.** Lecture [07](../07_segmentation.ipynb).
#
# **Time.** 35 minutes; the computer needs less than one.
#
# **Paper.** Section 3.1.

# %% jupyter={"source_hidden": true}
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from scipy.ndimage import binary_opening

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import sample_drive, sample_image_stage
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy
from semgrid_edu.networks import build_segmenter, load_net
from semgrid_edu.plotting.images import draw_image

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"  # pixels stay pixels
torch.set_num_threads(1)
SIGNAGE, PEDESTRIAN = KITTI_14.index("signage"), KITTI_14.index("pedestrian")
NAMES = {"segnet": "SegNet", "fcn": "FCN-8s", "deeplab": "DeepLab v2", "unet": "U-Net"}
TRAINED, SIZE = ("segnet", "fcn", "deeplab"), (96, 320)
drive = sample_drive()
frames = [drive[k] for k in range(len(drive))]
images = np.stack([resize_image(frame.image, SIZE) for frame in frames])
truths = np.stack([resize_labels(frame.labels.image, SIZE) for frame in frames])
nets = {name: load_net(sample_image_stage(name), drive.camera).segmenter for name in TRAINED}

# %% jupyter={"source_hidden": true}


def as_input(images):
    """Return what a network takes: (B, h, w, 3) uint8 -> (B, 3, h, w) float, 0..1."""
    return torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255


def legend_below(fig, labels):
    """Add a legend of the classes that occur below a figure."""
    plotting.class_legend(fig.axes[0], KITTI_14, labels)
    legend = fig.axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    legend.remove()
    fig.legend(legend.legend_handles, names, loc="outside lower center", ncols=5, fontsize="small")


# %% [markdown]
# ## The package's networks
#
# Each of the three, and U-Net as a fourth, comes in the published size, `paper`, and narrow enough for two cores,
# `compact`. Both sizes share what tells the networks apart:
#
# | | on the way down | on the way up | *where* comes from |
# |---|---|---|---|
# | SegNet | max-pooling, four times (five in `paper`) | unpooling by indices, then as many convolutions as down | indices |
# | FCN-8s | VGG16: max-pooling, five times | bilinear, 2x, 2x, 8x | sums with scores of two finer depths |
# | DeepLab v2 | ResNet: halves three times, then atrous | bilinear, 8x | a map that stays at 1/8 |
# | U-Net | max-pooling, four times | learnt doubling | whole maps of the encoder, side by side with its own |
#
# **Predict before you run.** The four compact networks have 0.2 to 0.5 million weights each. Which of them can see
# farthest? And which computes its scores on the finest map?
#
# <details><summary>Answer</summary>
#
# FCN, with a 7x7 kernel at 1/32 of the size: about 460 pixels, more than the 320 columns of the image. DeepLab's atrous
# layers see nearly as far. SegNet and U-Net score at every pixel, FCN and DeepLab at every eighth.
#
# </details>

# %% jupyter={"source_hidden": true}
CONV, HALVE, DOUBLE = (3, 1, 1), (2, 2, 1), (1, 1 / 2, 1)  # kernel, stride, rate
HALVING_CONV, ATROUS = (3, 2, 1), [(3, 1, 2)] * 4 + [(3, 1, 4), (3, 1, 8)]
BILINEAR_2, BILINEAR_8 = (2, 1 / 2, 1), (2, 1 / 8, 1)  # between two cells
VGG16 = [CONV, CONV, HALVE] * 2 + [CONV, CONV, CONV, HALVE] * 3
down, up = [HALVE, CONV, CONV], [DOUBLE, CONV, CONV]
CHAINS = {
    "segnet": [CONV, CONV, *[HALVE, CONV] * 2, *down, HALVE, *up, *[DOUBLE, CONV] * 2, *up],
    "fcn": [*VGG16, (7, 1, 1), BILINEAR_2, BILINEAR_2, BILINEAR_8],
    "deeplab": [(7, 2, 1), HALVING_CONV, CONV, CONV, HALVING_CONV, CONV, CONV, *ATROUS, BILINEAR_8],
    "unet": [CONV, CONV, *down * 4, *up * 4],
}
EVERY = {"segnet": 1, "fcn": 8, "deeplab": 8, "unet": 1}

# %% jupyter={"source_hidden": true}


def receptive_field(layers):
    """Return how many pixels a side one output sees: lecture 07."""
    field, jump = 1, 1
    for kernel, stride, rate in layers:
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field


def parameters(name, preset):
    """Return the number of weights and biases; PyTorch's "meta" device gives layers shapes without memory."""
    with torch.device("meta"):
        return sum(p.numel() for p in build_segmenter(name, len(KITTI_14), preset).parameters())


# %% jupyter={"outputs_hidden": true}
print("                parameters   (paper)   field [pixels]   a score every ... pixels")
for name in NAMES:
    sizes = f"{parameters(name, 'compact'):11,} {parameters(name, 'paper'):12,}"
    print(f"{NAMES[name]:<11} {sizes} {receptive_field(CHAINS[name]):12.0f} {EVERY[name]:16}")

# %% [markdown]
# The way up counts too: interpolation takes two cells along each axis, so each enlarging widens the field by one of its
# cells. (A pixel's own field can be some pixels wider or narrower, depending on where in its cell the pixel lies.)
#
# The field is what a pixel *can* see. The gradient tells what it does look at (backpropagation, lecture 06): by how
# much does the score of signage at one pixel of the lamp post (the cross) change with each pixel of the image?

# %% jupyter={"source_hidden": true} alt="three pictures of slopes, bright where the score of signage at the lamp post depends on the image; a cross marks the pixel, dotted lines the columns that hold the middle half, dashed lines the edges of the field: A SegNet, a square of about a hundred columns that ends shortly before the dashed lines; B FCN, nearly the whole width, most near the post; C DeepLab, blocks of eight pixels, strongest around the cross, that fade before the dashed line on the left"
fig, axes = plt.subplots(3, 1, figsize=(6, 6.1), layout="compressed")
looked = {}
for ax, letter, name in zip(axes, "ABC", TRAINED, strict=True):
    x = as_input(images[14:15]).requires_grad_()
    nets[name](x)[0, SIGNAGE, 60, 227].backward()
    slope = x.grad[0].abs().sum(dim=0)
    reached = np.flatnonzero(slope.sum(dim=0))[[0, -1]]
    half = np.searchsorted(slope.sum(dim=0).cumsum(0) / slope.sum(), [0.25, 0.75])
    looked[name] = (*abs(reached - 227), np.ptp(half))
    can_see = receptive_field(CHAINS[name]) / 2
    assert abs(reached - 227).max() <= can_see
    draw_image((slope / slope.max()).sqrt().mul(15).round().div(15), ax=ax, cmap="magma", vmin=0, vmax=1)
    ax.plot(227, 60, "x", color="cyan")
    for columns, style in ((half, ":"), ((227 - can_see, 227 + can_see), "--")):
        for column in columns:
            ax.axvline(column, color="white", linewidth=1, linestyle=style)
    ax.set_xlim(-0.5, 319.5)
    ax.set_title(f"{letter}: {NAMES[name]}", fontsize="medium")
fig.colorbar(axes[-1].images[0], ax=axes, label="square root of slope / largest", shrink=0.4)
plt.show()
for name, columns in looked.items():
    print("{:<11} columns reached to the left {}, to the right {}; middle half {}".format(NAMES[name], *columns))

# %% [markdown]
# (The pictures show the square root, so that small slopes can be seen too.) The dashed lines are the edges of the field
# (both of FCN's and DeepLab's right one lie outside the picture). SegNet uses nearly all of it, 51 of 56 columns to the
# left; so do FCN (221 of 230) and DeepLab (196 of 198), whose slopes also reach the right border of the image. But the
# slopes are unequal: half of their sum lies between the dotted lines, in 24 columns of SegNet, 67 of FCN and 51 of
# DeepLab. DeepLab's picture is made of blocks of 8 pixels, as wide as the cells of its map.
#
# ## Before the first label: ImageNet
#
# The paper doesn't start from random weights. It takes the encoders' weights from a network that has learnt to name what
# is on 1.3 million photographs (ImageNet), so that the labelled frames only have to teach the rest. A 3x3 layer from $a$
# to $b$ channels has $9ab + b$ numbers. VGG16's thirteen convolutions go from 3 channels to 64, 64, 128, 128, 256, 256,
# 256, and six times 512. By hand, the first two: 9 · 3 · 64 + 64 = 1,792 and 9 · 64 · 64 + 64 = 36,928.
#
# **Predict before you run.** Which have more numbers: the first ten layers, or the last three?
#
# <details><summary>Answer</summary>
#
# The last three have 7,079,424, the ten before them 7,635,264: about the same. Weights are where channels are many; time
# is where pixels are many.
#
# </details>

# %% jupyter={"outputs_hidden": true}
channels = [3, 64, 64, 128, 128, 256, 256, 256] + 6 * [512]
by_hand = [9 * a * b + b for a, b in pairwise(channels)]
with torch.device("meta"):
    wanted = build_segmenter("segnet", n_classes=14, preset="paper").imagenet_tensors()
assert sum(by_hand) == sum(tensor.numel() for tensor in wanted.values()) == 14_714_688
print(
    f"first ten {sum(by_hand[:10]):,}, last three {sum(by_hand[10:]):,}; names in the file:", *list(wanted)[:2], "..."
)

# %% [markdown]
# `load_imagenet(segmenter, path)` fills these from a file on your disk with torchvision's names, and refuses a file in
# which a name is missing or a shape differs. The project ships no such file: the compact networks start at random.
#
# All four of them use **batch normalisation**: of each channel subtract the mean and divide by the
# standard deviation, over all pixels of the batch; then let the network choose a new mean and scale. By hand: 1, 3, 5, 7
# has mean 4 and variance 5, so $-3/\sqrt5$, $-1/\sqrt5$, $1/\sqrt5$, $3/\sqrt5$. In training the mean and the spread of a
# channel are then set by these two learnt numbers alone, however the layers before it change. After training, running
# averages take the place of the batch's mean and variance, so that an image's scores don't depend on what else is in
# its batch.

# %%
values = torch.tensor([1.0, 3, 5, 7]).view(1, 1, 2, 2)
normalised = F.batch_norm(values, None, None, training=True, eps=1e-12)
np.testing.assert_allclose(normalised.flatten(), np.array([-3, -1, 1, 3]) / np.sqrt(5), rtol=1e-6)
both, alone = as_input(images[[8, 16]]), as_input(images[[8]])
with torch.inference_mode():
    torch.testing.assert_close(nets["segnet"](both)[:1], nets["segnet"](alone), atol=1e-3, rtol=1e-3)

# %% [markdown]
# ## On the drive
#
# All twenty frames of the sample drive. The networks have learnt from the labelled images of other simulated streets,
# 2000 steps each.
#
# **Predict before you run.** Which network finds thin posts best, those at most two pixels wide? And how far apart are
# the three in pixel accuracy, the share of all pixels that get their true class?
#
# <details><summary>Answer</summary>
#
# None finds much of them: FCN 27 % of their pixels, SegNet 22 %, DeepLab 16 %. In pixel accuracy two points lie between
# the best and the last.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two columns, frames 0 and 14, and four rows: true labels with thin yellow posts, then SegNet with ragged borders and specks, FCN and DeepLab with smooth blobs; where a thin post stands there are at most yellow patches"
called, matrices, scores_of = {}, {}, {}
for name in TRAINED:
    with torch.inference_mode():
        scores_of[name] = nets[name](as_input(images))
    called[name] = scores_of[name].argmax(dim=1).numpy()
    matrices[name] = confusion_matrix(truths, called[name], len(KITTI_14))
fig, axes = plt.subplots(4, 2, figsize=(8.6, 6.1), layout="constrained")
for column, k in enumerate((0, 14)):
    draw_image(KITTI_14.colours(truths[k]), ax=axes[0, column]).set_title(f"truth, frame {k}", fontsize="medium")
    for ax, name in zip(axes[1:, column], TRAINED, strict=True):
        draw_image(KITTI_14.colours(called[name][k]), ax=ax).set_title(NAMES[name], fontsize="medium")
legend_below(fig, truths[[0, 14]])
plt.show()


# %% jupyter={"outputs_hidden": true}
def of_class(c, m):
    """Return found (of its true pixels, called so), right (of those called so, true), area (called so, against true)."""
    return m[c, c] / m[c].sum(), m[c, c] / m[:, c].sum(), m[:, c].sum() / m[c].sum()


print(f"{'':29}signage               pedestrian")
print("[%]         pixels  classes   found  right  area    found  right  area")
for name, m in matrices.items():
    numbers = (pixel_accuracy(m), class_accuracy(m), *of_class(SIGNAGE, m), *of_class(PEDESTRIAN, m))
    row = "{:7.0f} {:8.0f} {:7.0f} {:6.0f} {:5.0f} {:8.0f} {:6.0f} {:5.0f}"
    print(f"{NAMES[name]:<11}" + row.format(*(100 * number for number in numbers)))
is_sign = truths == SIGNAGE
thin = is_sign & ~binary_opening(is_sign, np.ones((1, 1, 3)))  # runs of at most two pixels in a row
print("signage at most two pixels wide, found [%]:", end="")
print(*(f"  {NAMES[name]} {100 * (called[name] == SIGNAGE)[thin].mean():.0f}" for name in TRAINED))
shares = 100 * m.sum(axis=1)[[SIGNAGE, PEDESTRIAN]] / m.sum()
print("true pixels that are signage or pedestrian: {:.1f}, {:.1f}".format(*shares))

# %% [markdown]
# "Found" is the *recall* of a class, "right" its *precision*, and "area" the number of pixels called so, in per cent of
# those that are. SegNet's borders are detailed and ragged, with specks; FCN and DeepLab, which score every eighth
# pixel, draw smooth blobs. Sharp isn't right, though: SegNet finds fewer of the pixels of signage than the other two.
# All three call three to six times as many pixels pedestrian as there are. A likely reason is their loss, in which rare
# classes count more (lecture 08). This is one street with one training run each, so it doesn't rank the three; the
# paper's first claim does, and lecture [12](../12_experiments.ipynb) tests it.
#
# **Small classes.** Pixel accuracy hardly sees them. Forbid each network to say signage, pedestrian or bicycle, so that
# it says the best of the other classes:

# %%
small = [KITTI_14.index(name) for name in ("signage", "pedestrian", "bicycle")]
print("[%]         pixels, blind to small things   classes, blind to small things")
for name, m in matrices.items():
    with torch.inference_mode():
        scores = scores_of[name].clone()
        scores[:, small] = -torch.inf
    blind = confusion_matrix(truths, scores.argmax(dim=1).numpy(), len(KITTI_14))
    numbers = [100 * score(matrix) for score in (pixel_accuracy, class_accuracy) for matrix in (m, blind)]
    print(f"{NAMES[name]:<11}" + "{:7.1f} {:23.1f} {:9.1f} {:22.1f}".format(*numbers))
    assert numbers[0] < numbers[1]
    assert numbers[2] > numbers[3] + 10

# %% [markdown]
# Blind, each network gains about one point of pixel accuracy and loses more than ten of class accuracy. The classes are
# small, and more than two thirds of what the networks call signage or pedestrian is something else (*right* is 30 % at
# best), so little is lost by never saying it. By the first number alone you would choose the network that sees no
# pedestrian. So look at both, as the paper does.
#
# ## Where this breaks
#
# **Checkerboards.** Instead of unpooling, a network may *learn* to double: a transposed convolution puts a copy of its
# kernel, times the value, at every second pixel, and adds up. By hand, a kernel of three ones and a row of ones: inside
# the row, the pixels under two copies get 2, those under one copy 1.

# %%
print("kernel of 3:", F.conv_transpose1d(torch.ones(1, 1, 5), torch.ones(1, 1, 3), stride=2)[0, 0].numpy())
print("kernel of 2:", F.conv_transpose1d(torch.ones(1, 1, 5), torch.ones(1, 1, 2), stride=2)[0, 0].numpy())

# %% jupyter={"source_hidden": true} alt="four pictures of a flat map after doubling: A kernel 3, a checkerboard; B kernel 4, flat but for the border; C kernel 2, flat; D a random kernel of 2, one tile of 2 x 2 pixels again and again"
flat = torch.ones(1, 1, 9, 9)
layer = build_segmenter("unet", n_classes=14).up[0]  # 2x2, stride 2, at its first random weights
with torch.no_grad():
    ways = {
        "A: kernel 3": F.conv_transpose2d(flat, torch.ones(1, 1, 3, 3), stride=2),
        "B: kernel 4": F.conv_transpose2d(flat, torch.ones(1, 1, 4, 4), stride=2),
        "C: kernel 2": F.conv_transpose2d(flat, torch.ones(1, 1, 2, 2), stride=2),
        "D: kernel 2, random": layer(torch.ones(1, layer.in_channels, 9, 9))[:, :1],
    }
fig, axes = plt.subplots(1, 4, figsize=(8.6, 2.4), layout="constrained")
for ax, (name, picture) in zip(axes, ways.items(), strict=True):
    draw_image(picture[0, 0], ax=ax, cmap="viridis").set_title(name, fontsize="medium")
plt.show()

# %% [markdown]
# A flat map goes in; each picture runs from its smallest value, dark, to its largest, bright, and C has one value only.
# With a kernel of 3 the pattern is in the arithmetic (A). Kernels of 4 and 2, multiples of the stride, add up evenly (B,
# but for the border; C). In D the four weights of a 2x2 kernel differ, as they do before training, and the same tile of
# 2x2 pixels repeats. If a map of yours shows a pattern with a period of 2, 4 or 8 pixels, look for its cause on the way
# up first.
#
# **Another world.** The networks have seen simulated streets by daylight, mirrored by chance and with brightness and
# contrast varied by up to a fifth (*data augmentation*). Take seven of the same frames, and change them in a way that a
# human would cope with.
#
# **Predict before you run.** Which costs most: half or double the light, noise of 10 %, red and blue swapped, left and
# right swapped, or the image upside down? And upside down, how much of the road is still called road?
#
# <details><summary>Answer</summary>
#
# Upside down costs each network most: not one in a hundred pixels of the road is called road, nor one in a hundred of
# the sky sky. The networks have learnt where these *belong*, not only what they look like. Next come the noise for
# SegNet and FCN, and the swapped colours for DeepLab. Left and right swapped costs a point at most: that was in
# training.
#
# </details>

# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true, "source_hidden": true}
some, true = images[::3], truths[::3]
changes = {
    "as it is": some,
    "half the light": some // 2,
    "double the light": np.minimum(some.astype(int) * 2, 255).astype(np.uint8),
    "noise of 10 %": np.clip(some + np.random.default_rng(0).normal(0, 25, some.shape), 0, 255).astype(np.uint8),
    "red and blue swapped": some[..., ::-1].copy(),
    "left and right swapped": some[:, :, ::-1].copy(),
    "upside down": some[:, ::-1].copy(),
}
turned, cost = {"left and right swapped": true[:, :, ::-1], "upside down": true[:, ::-1]}, {}
print(f"pixel accuracy [%]     {'SegNet':>12} {'FCN-8s':>12} {'DeepLab v2':>12}")
for change, changed in changes.items():
    expected = turned.get(change, true)
    for name in TRAINED:
        classes = nets[name](as_input(changed)).detach().argmax(dim=1).numpy()
        cost[change, name] = pixel_accuracy(confusion_matrix(expected, classes, len(KITTI_14)))
        if change == "upside down":
            assert all((classes[expected == c] == c).mean() < 0.01 for c in map(KITTI_14.index, ("road", "sky")))
    print(f"{change:<22}", *(f"{100 * cost[change, name]:12.0f}" for name in TRAINED))
assert all(cost["red and blue swapped", name] < cost["as it is", name] - 0.1 for name in TRAINED)
assert all(cost["noise of 10 %", name] < 0.55 * cost["as it is", name] for name in ("segnet", "fcn"))
assert cost["noise of 10 %", "deeplab"] > cost["as it is", "deeplab"] - 0.1
assert all(cost["left and right swapped", name] > cost["as it is", name] - 0.01 for name in TRAINED)
assert all(cost["upside down", name] == min(cost[change, name] for change in changes) for name in TRAINED)

# %% [markdown]
# Noise costs SegNet three quarters of its accuracy, FCN half and DeepLab a tenth. Where does it get in? Compare the
# first layer's result, after its normalisation, with and without noise:

# %% jupyter={"source_hidden": true}


def noise_share(clean, noisy):
    """Return the strength of the noise in channels (B, C, h, w), relative to that of the clean picture."""
    return ((noisy - clean).std() / (clean - clean.mean(dim=(0, 2, 3), keepdim=True)).std()).item()


print("noise relative to the picture:")
for name in TRAINED:
    clean, noisy = ((as_input(changes[c]) - nets[name].mean) / nets[name].std for c in ("as it is", "noise of 10 %"))
    first = [part for part in nets[name].modules() if isinstance(part, torch.nn.Conv2d | torch.nn.BatchNorm2d)][:2]
    with torch.inference_mode():
        inside = [first[1](first[0](x)) for x in (clean, noisy)]
    print(f"{NAMES[name]:<11} image {noise_share(clean, noisy):.1f}, after the first layer {noise_share(*inside):.1f}")

# %% [markdown]
# The first layers of SegNet and FCN, with kernels of 3x3, amplify the noise; DeepLab's, with kernels of 7x7, damps it.
# Two swapped colours are a common bug (OpenCV reads blue first): no error is raised, and each of the three loses more
# than ten points. Lecture 07's real street was another world, too; lecture [13](../13_real_drive.ipynb) measures more
# of it.
#
# ## In five lines
#
# 1. The field is what a score can see; the gradient says where it looks, and half of that is in about a fifth of the
#    columns that it reaches.
# 2. The paper's encoders start from ImageNet; the compact networks start at random, with batch normalisation.
# 3. Ask for found, right and area of each class: pixel accuracy hardly sees a post or a pedestrian.
# 4. A doubling layer can print a pattern on a flat map; its period is that of its stride.
# 5. Turn the image upside down, and hardly a pixel of the road is called road: a network learns where things belong.
#
# ## Further reading
#
# - Ronneberger, Fischer, Brox, *U-Net: convolutional networks for biomedical image segmentation*, MICCAI 2015.
# - Odena, Dumoulin, Olah, *Deconvolution and checkerboard artifacts*, Distill 2016.
# - Luo, Li, Urtasun, Zemel, *Understanding the effective receptive field in deep convolutional neural networks*, NIPS
#   2016: what a pixel can see, and what it looks at.
# - Ioffe, Szegedy, *Batch normalization*, ICML 2015. Simonyan, Zisserman, *Very deep convolutional networks for
#   large-scale image recognition*, ICLR 2015: VGG16. He, Zhang, Ren, Sun, *Deep residual learning for image
#   recognition*, CVPR 2016: ResNet.
