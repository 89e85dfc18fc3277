# %% [markdown]
# # 07 · Three networks for segmentation
#
# **In one sentence.** To call a pixel *post*, a network must see what stands around it, and must remember exactly where
# the pixel is; making the image smaller helps with the first and loses the second, and SegNet, FCN and DeepLab get it
# back in three ways: indices, skips and atrous convolutions.
#
# **You will be able to**
# - turn scores into a loss and its gradient by hand;
# - say why scores and not probabilities go on to the planes, and what a score of zero means there;
# - compute a convolution with any stride and rate, and how much of the image a chain of them sees;
# - unpool by indices, add a skip and spread a kernel on a few numbers, and say what each does to a thin post;
# - tell a network that has learnt a street from one that has learnt a view.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb); lecture [06](06_planes.ipynb) for bilinear sampling and
# backpropagation. For the graph: [graphical models](01b_graphical_models.ipynb). You need no deep learning.
#
# **Time.** 111 minutes; the computer needs about one.
#
# **Paper.** Section 3.1, which names the three networks.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from IPython.display import Markdown
from ipywidgets import IntSlider, interact

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import real_drive, sample_drive, sample_image_stage, sample_weights
from semgrid_edu.fast import track_drive
from semgrid_edu.graphical import d_separated
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy
from semgrid_edu.networks import load_net
from semgrid_edu.networks.deeplab import interpolate
from semgrid_edu.networks.fcn import enlarge
from semgrid_edu.plotting.images import draw_image

# %% jupyter={"source_hidden": true}
from worlds.lecture_00_ledger import ledger, ledger_table
from worlds.lecture_07_post import believed_of_post, post_pixels
from worlds.lecture_07_thin_pole import (
    MECHANISMS,
    apply_mechanism,
    draw_poles,
    place_and_width,
    score_poles,
    train_pole_net,
)

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"  # pixels stay pixels
torch.set_num_threads(1)  # on maps this small, two threads wait for each other; and the results stay the same
POST, SIZE, rng = KITTI_14.index("signage"), (96, 320), np.random.default_rng(0)
NAMES = {"segnet": "SegNet", "fcn": "FCN-8s", "deeplab": "DeepLab v2"}

# %% jupyter={"source_hidden": true}


def seen_by_networks(frames):
    """Return images (B, 96, 320, 3) and labels (B, 96, 320) at the size that the compact networks see."""
    images = np.stack([resize_image(frame.image, SIZE) for frame in frames])
    return images, np.stack([resize_labels(frame.labels.image, SIZE) for frame in frames])


def as_input(images):
    """Return what a network takes: (B, h, w, 3) uint8 -> (B, 3, h, w) float, 0..1."""
    return torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255


def to_torch(array):
    """Return what PyTorch's layers take: (h, w) or (w,) -> (1, 1, h, w), double."""
    return torch.from_numpy(np.atleast_2d(np.asarray(array, float)))[None, None]


# %% jupyter={"source_hidden": true}


def legend_below(fig, labels):
    """Add a legend of the classes that occur below a figure."""
    plotting.class_legend(fig.axes[0], KITTI_14, labels)
    legend = fig.axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    legend.remove()
    fig.legend(legend.legend_handles, names, loc="outside lower center", ncols=5, fontsize="small")


drive = sample_drive()
images, truths = seen_by_networks([drive[k] for k in range(len(drive))])
nets = {name: load_net(sample_image_stage(name), drive.camera).segmenter for name in NAMES}
NOW, CROP = 14, (slice(10, 82), slice(196, 236))  # the frame of all pictures; its sign and its lamp post

# %% [markdown]
# ## A sign moves by one pixel at a time
#
# Here are a road sign and a lamp post of the drive, as the labels of frame 14 have them. The sign's post is one or
# two pixels wide. Each picture beside it was made smaller, to a quarter of its height and width (G was only blurred),
# and then brought back to full size, in one of six ways. Nothing is learnt here. Watch what happens as the street
# moves to the right, one pixel a step:

# %% jupyter={"source_hidden": true} alt="animation: A, a sign on a thin post and a lamp post move to the right; B and C, brought back from maxima, the posts are wide and move in jumps of four pixels; D, indices, the posts are dotted lines in the right place; E, skips, a sharp post within a faint, wider one; F, strided, blurred, and the thin post changes its brightness and shape; G, atrous, blurred, and it moves evenly"


def moving():
    """Yield the figure for each shift of the true sign and post."""
    fig = plt.figure(figsize=(8.6, 2.6), layout="constrained")
    thing = (truths[NOW] == POST).astype(float)
    for shift in range(5):
        fig.clear()
        image = np.roll(thing, shift, axis=1)[CROP]
        pictures = {"true": image, **{way: apply_mechanism(image, way) for way in MECHANISMS}}
        for ax, letter, (name, picture) in zip(fig.subplots(1, 7), "ABCDEFG", pictures.items(), strict=True):
            draw_image(picture, ax=ax, cmap="magma", vmin=0, vmax=1).set_title(f"{letter}: {name}", fontsize="medium")
        yield fig


plotting.animate(moving(), period=0.6, alt="a thin post moves by single pixels and is brought back in six ways")

# %% [markdown]
# A is the truth. B and C kept the largest value of each 4 x 4 pixels: the posts are wide, and each part of them moves
# in jumps of four pixels, because the exact place is lost. D (SegNet's *indices*) has them in the right place, but as
# dotted lines. E (FCN's *skips*) has a sharp post within a fainter, wider one. F blurred and kept every second pixel
# only, twice: the brightness of the thin post changes from step to step. G (DeepLab's *atrous* convolution) is blurred
# too, but moves evenly. This lecture explains each of these pictures on a few numbers, and then asks what learning
# repairs.
#
# ### The graph
#
# A network gives each pixel scores, and a soft-max (next section) turns the scores of *one* pixel into probabilities. The
# network has seen the pixels around, but it names each pixel without asking for its neighbours' *labels*. And labels
# along a post depend on each other, here as a chain. $x_1 \dots x_5$ are the labels of five pixels from top to bottom,
# $s_k$ the class that the scores prefer at pixel $k$ (elsewhere $s$ are the scores themselves), right with probability
# 0.73. A neighbour has the same label with probability 0.8.
#
# **Predict before you run.** The scores say post, post, *something else*, post, post. Is the third pixel a post? Then go
# *across* a post that is one pixel wide: else, else, post, else, else. What does the same chain say of the third pixel
# now? Draw the graph: with all scores known, are $x_1$ and $x_5$ independent?
#
# <details><summary>Answer</summary>
#
# Along: 0.66, because four neighbours speak for a post; the soft-max alone says 0.27, a gap. Across: 0.34 instead of
# 0.73. The edge that closes a gap also erases what is thin. $x_1$ and $x_5$ are dependent through the chain of labels;
# they become independent when a label between them is known.
#
# </details>

# %% jupyter={"outputs_hidden": true}
stage = post_pixels()
for name, says in (("along", [1, 1, 0, 1, 1]), ("across", [0, 0, 1, 0, 0])):
    exact, alone = believed_of_post(says)[:, 2]
    print(f"{name:<6} the post: exact {exact:.2f}, soft-max of the pixel alone {alone:.2f}")
scores_known = tuple(stage.observed)
assert not d_separated(stage.model, "x1", "x5", given=scores_known)
assert d_separated(stage.model, "x1", "x5", given=(*scores_known, "x3"))
is_post = truths == POST
below, beside = (a[b].mean() for a, b in ((is_post[:, 1:], is_post[:, :-1]), (is_post[..., 1:], is_post[..., :-1])))
print(
    f"on the drive {is_post.mean():.0%} of the pixels are signage; below one of them is signage with {below:.2f}",
    end=", ",
)
print(f"beside it with {beside:.2f}")

# %% tags=["graph"] jupyter={"source_hidden": true, "outputs_hidden": true} alt="a directed graph: labels x1 to x5 in a chain, below each, grey because it is observed, what its scores say, s1 to s5; the arrow from x2 to the circled x3 is dashed and carries the price of cutting all four, .66 to .27"
fig, ax = plt.subplots(figsize=(8.4, 2.6), layout="constrained")
stage.draw(ax, highlight=["x3"])
plt.show()

# %% [markdown]
# So one strength for both directions is wrong for signage: it needs a stronger edge along a post than across. The
# networks of this lecture cut all four arrows between labels (the price of all four is on the dashed one). Lecture
# [10](10_crf.ipynb) puts such edges back, on the map.
#
# ## What comes out: a score for each class
#
# One pixel, three classes: road, post, sky. A network gives it the scores 1, 3, 0. (KITTI's labels have one class for
# signs and poles, *signage*, painted yellow.) They are no probabilities, just numbers; the field calls them *logits*.
# The largest says post. To make probabilities, exponentiate and divide by the sum: *soft-max*. By hand: $e^1 = 2.72$,
# $e^3 = 20.09$, $e^0 = 1$; the sum is 23.8; so 0.11, 0.84, 0.04.
#
# Is that good? If the pixel truly is a post, its *cross-entropy* is $-\log 0.84 = 0.17$; if it is road, $-\log 0.11 =
# 2.17$. The loss of an image is the mean over its labelled pixels; an unlabelled pixel (255) counts neither in the sum
# nor in the number of pixels.
#
# **Predict before you run.** Add 5 to all three scores: how does the loss change? And the derivative of the loss with
# respect to each score, for a true post: which of the three are negative?
#
# <details><summary>Answer</summary>
#
# Adding changes nothing: $e^5$ stands above and below, and cancels. The derivative is **probability minus truth**: 0.11,
# 0.84 - 1 = -0.16, 0.04. Gradient descent on the scores raises that of the true class, and lowers each other one in
# proportion to its probability.
#
# </details>
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}}, \qquad \text{loss} = -\log P(c^*), \qquad
#    \frac{\partial\,\text{loss}}{\partial s_c} = P(c) - [c = c^*] $$
#
# ($s_c$: the score of class $c$ at one pixel; $c^*$: its true class; $[\ldots]$ is 1 if true, else 0.)


# %% tags=["segmentation"] jupyter={"outputs_hidden": true}
def cross_entropy(scores, true):
    """Return -log P(true class) of one pixel; scores (C,)."""
    odds = np.exp(scores)
    return -np.log(odds[true] / odds.sum())


s = torch.tensor([1.0, 3.0, 0.0], dtype=torch.float64, requires_grad=True)
loss = F.cross_entropy(s[None], torch.tensor([1]))
loss.backward()
np.testing.assert_allclose(cross_entropy(s.detach().numpy(), 1), loss.item())
np.testing.assert_allclose(s.grad, torch.softmax(s.detach(), dim=0) - torch.tensor([0, 1, 0]))
print(f"loss {loss:.2f}, with 5 added {cross_entropy(s.detach().numpy() + 5, 1):.2f}", end=", ")
print("gradient", s.grad.numpy().round(2))

# %% [markdown]
# ## Why scores, not probabilities, go to the planes
#
# The paper hands the *scores* to the planes of lectures 05 and 06. Does it matter? Take two neighbouring pixels, and
# post against everything else. In the left pixel post leads by 6 (its *margin*), in the right one it trails by 1:
# nearly sure, and
# undecided. A point of a plane falls halfway between the two.
#
# **Predict before you run.** How probable is post at that point if you interpolate scores? If you interpolate
# probabilities?
#
# <details><summary>Answer</summary>
#
# Scores: a lead of 2.5, that is 0.92. Probabilities: (0.998 + 0.269) / 2 = 0.63. With scores, the pixel that knows more
# counts more.
#
# </details>


# %% jupyter={"outputs_hidden": true}
def logistic(lead):
    """Return the soft-max of two classes, by how far the one leads."""
    return 1 / (1 + np.exp(-np.asarray(lead, float)))


lead = np.array([6, -1])
print(f"scores interpolated {logistic(lead.mean()):.2f}, probabilities interpolated {logistic(lead).mean():.2f}")
for lead in (0, 6, 12):
    P = logistic(lead)
    print(f"lead {lead:2d}: P = {P:.6f}, slope P (1 - P) = {P * (1 - P):.6f}")

# %% [markdown]
# Three reasons, then. The difference of two scores is a logarithm of odds, and what follows the planes sums scores
# (lecture 08): adding logarithms multiplies evidence, as in lecture [02](02_grids.ipynb). A soft-max hides how strong the
# evidence was: leads of 6 and 12 both become nearly 1. And a gradient that comes back from the map would be multiplied by
# the slope of the soft-max, so that hardly anything would get through a pixel that is sure.
#
# ### On the planes a zero says "nobody looked"
#
# Under a soft-max any number may be added to all scores of a pixel. On the planes that is no longer free. A point that
# no pixel shows gets zeros (lecture 06). So zero has a meaning there: *nobody looked*. By hand: one cell has points on
# two planes. Pixels show both, and give *car* the score -2 each: no car here. Another cell lies outside the image: 0 and
# 0. The next layer sums and applies $\max(0, \cdot)$ (*ReLU*), once to the sum and once to minus the sum:
#
# | | sum | speaks for a car | speaks against a car |
# |---|---|---|---|
# | both points seen, -2 each | -4 | 0 | 4 |
# | nobody looked | 0 | 0 | 0 |
# | both seen, after adding 5 to all scores: 3 each | 6 | **6** | **0** |
#
# **Predict before you run.** Take the whole trained network of the course, and add 1 or 5 to all scores of the image
# before they go to the planes. No class gains on any other in any pixel. How many cells of the map change their class?
# And if each pixel's scores are first shifted so that their mean is 0?
#
# <details><summary>Answer</summary>
#
# With 1 added about a tenth of the cells change, and with 5 a quarter to a half. Shifting the mean to 0 changes two to
# four cells in a hundred, because that mean is already close to 0. Log-probabilities instead of scores, which are all
# negative, change about half of the map or more.
#
# </details>

# %%
for belief in track_drive(drive[: NOW + 1], spec := load_net(sample_weights(), drive.camera).architecture.grid):
    occupancy = torch.tensor(belief.probability, dtype=torch.float32)[None]
CHANGES = {
    "1 added": lambda s: s + 1,
    "5 added": lambda s: s + 5,
    "5 taken away": lambda s: s - 5,
    "mean shifted to 0": lambda s: s - s.mean(dim=1, keepdim=True),
    "log-probabilities": lambda s: F.log_softmax(s, dim=1),
}


# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true}
@torch.inference_mode()
def map_of(net, change=lambda s: s):
    """Return the classes of the map when the scores are changed before they go to the planes, (H, W)."""
    return net.fusion(net.sampler(change(scores_of[net])), occupancy)[0].argmax(dim=0)


wholes = [load_net(sample_weights(name), drive.camera) for name in NAMES]
with torch.inference_mode():
    scores_of = {net: net.segmenter(as_input(images[NOW : NOW + 1])) for net in wholes}
unchanged = {net: map_of(net) for net in wholes}
print("cells of the map that change their class [%]:", *NAMES.values(), sep="  ")
for name, change in CHANGES.items():
    shares = [100 * (map_of(net, change) != unchanged[net]).float().mean() for net in wholes]
    print(f"{name:<40}" + "".join(f"{share:10.0f}" for share in shares))
    low, high = {"1 added": (5, 20), "5 added": (20, 60), "mean shifted to 0": (1, 6)}.get(name, (25, 75))
    assert low < min(shares) <= max(shares) < high
means = [scores_of[net].mean(dim=1).abs().mean() for net in wholes]
print("how far the mean of a pixel's scores lies from 0:", *(f"{mean:.1f}" for mean in means))

# %% [markdown]
# So the scores carry more than a soft-max shows: the next layers have learnt what lies above and below "nobody looked".
# If you put a network of your own before layers that were trained with scores, don't hand over log-probabilities.
#
# ## Down: to see what is around
#
# ### A convolution, by hand
#
# Why would anybody make the image smaller? Begin with what a layer can see. A row of eight pixels: a post one pixel
# wide, and a door two pixels wide.
#
# ```
# row                 0    0    1    0    0    1    1    0
# kernel -1 2 -1      0   -1    2   -1   -1    1    1   -1      twice a pixel, minus its two neighbours
# ```
#
# What is thin gets a 2, what is wider gets less. Set negative values to zero (ReLU), and you have a detector of thin
# things. A layer of a network has many such kernels, with learnt weights; what each of them makes is a *channel*. A
# layer may compute fewer outputs than it has inputs: with **stride** 2 it computes every second one.
#
# **Predict before you run.** Of the outputs above, stride 2 keeps those of columns 0, 2, 4, 6: 0, 2, -1, 1. Now the post
# stands one pixel further left, in column 1. What is left of it?
#
# <details><summary>Answer</summary>
#
# Columns 0 and 2 are now -1 and -1, and after ReLU nothing: the post is gone. What a strided layer sees of a thin thing
# depends on whether it stands in an even or an odd column, as in picture F.
#
# </details>
#
# $$ \text{out}[v, u] = \sum_{n=0}^{2} \sum_{m=0}^{2} \text{kernel}[n, m]\;
#    \text{in}[\text{stride}\, v + \text{rate}\, (n - 1),\; \text{stride}\, u + \text{rate}\, (m - 1)] $$


# %% jupyter={"outputs_hidden": true}
def convolve(image, kernel, stride=1, rate=1):
    """Return a 3x3 convolution of one channel; outside the image everything is zero."""
    h, w = image.shape
    padded = np.pad(image, rate)
    out = np.zeros((-(-h // stride), -(-w // stride)))
    for v, u in np.ndindex(out.shape):
        for n, m in np.ndindex(3, 3):
            out[v, u] += kernel[n, m] * padded[stride * v + rate * n, stride * u + rate * m]
    return out


image, kernel = rng.normal(size=(9, 12)), rng.normal(size=(3, 3))
for stride, rate in ((1, 1), (2, 1), (1, 2), (3, 2)):
    by_torch = F.conv2d(to_torch(image), to_torch(kernel), stride=stride, padding=rate, dilation=rate)
    np.testing.assert_allclose(convolve(image, kernel, stride, rate), by_torch[0, 0], atol=1e-12)
row, moved, thin = np.array([[0.0, 0, 1, 0, 0, 1, 1, 0]]), np.array([[0.0, 1, 0, 0, 0, 1, 1, 0]]), np.zeros((3, 3))
thin[1] = -1, 2, -1
print("stride 2:", convolve(row, thin, stride=2)[0], "  post moved:", convolve(moved, thin, stride=2)[0])

# %% [markdown]
# (The **rate** comes with DeepLab; with rate 1 the kernel's weights are neighbours.) Such a kernel also answers to window
# frames, fence slats and lane marks, since nine pixels can't tell which is which. The network has to look further.
#
# ### How far does a pixel see?
#
# One 3x3 convolution sees 3 pixels a side (its *receptive field*, or field). A second one on top sees 5, a third 7. Now halve the map after the first:
# neighbours in the map then lie 2 pixels of the *image* apart (the *jump*), and each further layer adds 2 · 2 pixels:
#
# | layer | kernel | stride | rate | adds (kernel - 1) · rate · jump | field | jump after |
# |---|---|---|---|---|---|---|
# | convolution | 3 | 1 | 1 | 2 · 1 · 1 = 2 | 1 + 2 = 3 | 1 |
# | halving, 2x2 | 2 | 2 | 1 | 1 · 1 · 1 = 1 | 4 | 2 |
# | convolution | 3 | 1 | 1 | 2 · 1 · 2 = 4 | 8 | 2 |
# | convolution of rate 2 | 3 | 1 | 2 | 2 · 2 · 2 = 8 | 16 | 2 |
#
# To see 128 pixels without any halving takes 64 layers, all of them at full size: 1 + 2 · 64 = 129. If the map is halved
# after every second layer, ten are enough, and the last of them cost little: a map of a sixteenth of the height and width
# has 256 times fewer pixels.


# %% tags=["receptive-field"]
def receptive_field(layers):
    """Return how many pixels a side one output sees, and how many pixels apart two outputs lie."""
    field, jump = 1, 1
    for kernel, stride, rate in layers:
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field, jump


CONV, HALVE = (3, 1, 1), (2, 2, 1)  # kernel, stride, rate
assert receptive_field([CONV, HALVE, CONV, (3, 1, 2)]) == (16, 2)
halving = ([CONV, CONV, HALVE] * 5)[:14]  # ten convolutions, four halvings
print("64 layers, no halving:", receptive_field([CONV] * 64)[0], "pixels;  10 layers:", receptive_field(halving)[0])

# %% [markdown]
# So that is why networks go down: halving is the cheap way to see far.
#
# ### What is lost
#
# There are three usual ways to halve. *Max-pooling* takes the largest of each 2x2 window, *average pooling* their mean,
# *stride 2* every second value. Take a row of 16 pixels with a post of 1 in column 8, and halve it twice.
#
# **Predict before you run.** Four numbers are left. Which, for each of the three? And for a post in column 9, 10, 11?
#
# <details><summary>Answer</summary>
#
# Max: 0 0 1 0 for all four columns; the place within the four is gone. Average: 0 0 ¼ 0 for all four; place and
# strength are gone. Stride: 0 0 1 0 for column 8, and nothing at all for the three others.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for column in (8, 9, 10, 11):
    row = torch.eye(16)[column].view(1, 1, 16)
    by_max = F.max_pool1d(F.max_pool1d(row, 2), 2)
    by_mean = F.avg_pool1d(F.avg_pool1d(row, 2), 2)
    print(f"column {column}: max {by_max[0, 0].numpy()}, mean {by_mean[0, 0].numpy()}, stride {row[0, 0, ::4].numpy()}")

# %% [markdown]
# Of the three, only max-pooling keeps a *bright* thin thing at full strength wherever it stands. (The posts of these
# toys are bright; the exercise has a dark one.) Each halving forgets one bit of *where* across and one down. How do you
# get those bits back?
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
# On the way up, each maximum goes back to where it came from, and the rest of the map is zero: **unpooling**. The 1 in
# the corner was second in its window, so it is lost. Three in four numbers of an unpooled map are zero, and the
# convolutions that follow have to fill the holes.
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
    """Return a map of zeros with each maximum put back where it was."""
    image = np.zeros(shape)
    image.flat[indices.ravel()] = pooled.ravel()
    return image


by_hand = np.array([[1.0, 0, 0, 2], [0, 3, 0, 0], [0, 0, 4, 0], [5, 0, 0, 0]])
for image in (by_hand, rng.normal(size=(6, 10))):
    pooled, indices = max_pool(image)
    values, places = F.max_pool2d(to_torch(image), 2, return_indices=True)
    np.testing.assert_array_equal(indices, places[0, 0])
    np.testing.assert_allclose(unpool(pooled, indices, image.shape), F.max_unpool2d(values, places, 2)[0, 0])

# %% [markdown]
# The indices cost two bits a window and no weights. On the drive, take the channel of the trained SegNet, before its
# first pooling, that answers most strongly to sign and lamp post. Pool it once, and bring it back in two ways:

# %% jupyter={"source_hidden": true} alt="four pictures of sign and lamp post: A the image; B a channel of SegNet with thin bright lines; C the same after pooling and giving each value to four pixels, lines twice as wide and stepped; D after unpooling by indices, the lines dotted in their place"
segnet = nets["segnet"]
with torch.inference_mode():
    channels = segnet.conv_deconv.encoder[0]((as_input(images[NOW : NOW + 1]) - segnet.mean) / segnet.std)
    inside = torch.from_numpy(truths[NOW] == POST)
    contrast = (channels[0, :, inside].mean(dim=1) - channels[0].mean(dim=(1, 2))) / channels[0].std(dim=(1, 2))
    channel = channels[:, [contrast.argmax()]]
    pooled, indices = F.max_pool2d(channel, 2, return_indices=True)
    ways = {
        "B: before pooling": channel,
        "C: back, each to all four": F.interpolate(pooled, scale_factor=2),
        "D: back, by the indices": F.max_unpool2d(pooled, indices, 2),
    }
fig, axes = plt.subplots(1, 4, figsize=(8.4, 3.9), layout="constrained")
draw_image(images[NOW][CROP], ax=axes[0]).set_title("A: part of frame 14", fontsize="medium")
for ax, (name, way) in zip(axes[1:], ways.items(), strict=True):
    shares = way[0, 0][CROP] / channel[0, 0][CROP].max()
    draw_image(shares, ax=ax, cmap="magma", vmin=0, vmax=1).set_title(name, fontsize="medium")
fig.colorbar(axes[-1].images[0], ax=axes, label="value / largest", shrink=0.6)
plt.show()

# %% [markdown]
# Bright is large. In C the lines are two pixels wide or more, and which of the two they stood in is lost. In D each
# maximum lies where it lay, with holes between: the dotted line of the animation.
#
# ## FCN: add what finer maps say
#
# FCN keeps no indices. It scores the classes at three depths, enlarges the coarse scores by bilinear interpolation, and
# *adds* the finer ones: a **skip**. By hand, on a row of eight pixels; scores of post against the rest:
#
# ```
# coarse, each for two pixels    -3        -3         3        -3
# enlarged                       -3   -3   -3  -1.5  1.5  1.5 -1.5  -3     something is there, some two pixels wide
# fine                           -2    2   -2   -2   -2    2   -2   -2     two thin lines: a crack in a wall, a post
# sum                            -5   -1   -5  -3.5 -0.5  3.5 -3.5  -5     one post, one pixel wide
# ```
#
# Coarse knows *what*, fine knows *where*; here neither alone is right, and their sum is. A cell of a pooled map covers
# two pixels, so its value belongs *between* them, at columns 0.5, 2.5, 4.5, 6.5. Column 3 is a quarter of the way from
# 2.5 to 4.5: -3 + 6/4 = -1.5.
#
# **Predict before you run.** In DeepLab's map cell $i$ lies *on* pixel 8 $i$, because all its strides start at the
# first pixel. Enlarge such a map as if its cells covered pixels 8 $i$ to 8 $i$ + 7: by how much is every post off?
#
# <details><summary>Answer</summary>
#
# The middle of pixels 0 to 7 is 3.5. So everything lands 3.5 pixels too far right, and as far too low: nearly half a
# cell. It is the mistake of lecture 06, where it was half a pixel.
#
# </details>


# %% tags=["skips"] jupyter={"outputs_hidden": true}
def enlarge_row(scores, factor):
    """Enlarge: cell i covers pixels factor i .. factor (i + 1) - 1; beyond the outermost middles it stays constant."""
    middle = (np.arange(len(scores)) + 0.5) * factor - 0.5
    return np.interp(np.arange(len(scores) * factor), middle, scores)


def interpolate_row(scores, stride, width):
    """Interpolate: cell i lies on pixel stride i."""
    return np.interp(np.arange(width), stride * np.arange(len(scores)), scores)


coarse, fine = np.array([-3.0, -3, 3, -3]), np.array([-2.0, 2, -2, -2, -2, 2, -2, -2])
np.testing.assert_allclose(enlarge_row(coarse, 2), enlarge(to_torch(coarse), 2, (1, 8))[0, 0, 0])
np.testing.assert_allclose(interpolate_row(coarse, 8, 32), interpolate(to_torch(coarse), 8, (1, 32))[0, 0, 0])
print("sum:", enlarge_row(coarse, 2) + fine)
ramp = 8.0 * np.arange(8)  # each cell's value is the pixel that it lies on
print("off by", (interpolate_row(ramp, 8, 64) - enlarge_row(ramp, 8))[8:56].mean(), "pixels")

# %% [markdown]
# On the drive: by how much does *signage* lead over the best other class? First in FCN's scores at 1/32 of the image's
# size, then with those after the fourth pooling added (1/16), then the third (1/8), and enlarged to the image.

# %% jupyter={"source_hidden": true} alt="four maps of the lead of signage, orange where it leads: A at 1/32 five large cells on the right; B at 1/16 none; C at 1/8 small patches; D the same enlarged, smooth blobs, with arrows to a distant street lamp, the sign and the lamp post"
fcn = nets["fcn"]
with torch.inference_mode():
    _, _, pool3, pool4, pool5 = fcn.backbone((as_input(images[NOW : NOW + 1]) - fcn.mean) / fcn.std)
    at_32 = fcn.score_conv7(fcn.conv7(fcn.conv6(pool5)))
    at_16 = enlarge(at_32, 2, pool4.shape[2:]) + fcn.score_pool4(pool4)
    at_8 = enlarge(at_16, 2, pool3.shape[2:]) + fcn.score_pool3(pool3)
    whole = enlarge(at_8, 8, SIZE)
    torch.testing.assert_close(whole, fcn(as_input(images[NOW : NOW + 1])))
parts = {"A: 1/32": at_32, "B: 1/16, pool4 added": at_16, "C: 1/8, pool3 added": at_8, "D: enlarged": whole}
fig, axes = plt.subplots(2, 2, figsize=(8.4, 3.1), layout="constrained")
for ax, (name, part) in zip(axes.flat, parts.items(), strict=True):
    others = torch.cat([part[0, :POST], part[0, POST + 1 :]]).max(dim=0).values
    draw_image(part[0, POST] - others, ax=ax, cmap="PuOr_r", vmin=-4, vmax=4).set_title(name, fontsize="medium")
style = {"arrowprops": {"arrowstyle": "->", "color": "white"}, "fontsize": 9, "color": "white"}
axes[1, 1].annotate("lamp post", (227, 66), (245, 88), **style)
axes[1, 1].annotate("street lamp", (168, 25), (70, 20), **style)
axes[1, 1].annotate("sign", (210, 27), (258, 46), **style)
fig.colorbar(axes[0, 0].images[0], ax=axes, label="lead of signage", fraction=0.02)
plt.show()

# %% [markdown]
# Orange is where signage leads. In A it leads in five large cells on the right, in B nowhere; but only the last sum was
# trained to be right, and a constant may sit in one part and be taken back by another. pool3 brings signage to the lamp post, a distant street lamp and the sign, and to some spots
# without any. But the finest map has cells of 8 pixels, and the sign's post is one or two pixels wide: hardly any of it
# is found. A skip gives back what its finest map holds, and no more.
#
# ## DeepLab: don't halve, spread the kernel
#
# Halving has two effects: fewer pixels, and kernels that see further. Only the second is wanted. So leave the stride
# out, and give the kernels *holes* instead (French: *à trous*): **rate** 2 puts zeros between the weights. By hand, a
# row with one post, and the kernel 1 2 3:
#
# ```
# row                   0    0    0    1    0    0    0    0
# rate 1                0    0    3    2    1    0    0    0       sees 3 pixels
# rate 2                0    3    0    2    0    1    0    0       sees 5, with the same three weights
# ```
#
# **Predict before you run.** Halve the row by stride 2 (columns 0, 2, 4, 6), then convolve with rate 1. Which numbers of
# a convolution with rate 2 on the *whole* row are those? And three layers of rate 2 have a field of 13 pixels: of these,
# how many count?
#
# <details><summary>Answer</summary>
#
# Those of columns 0, 2, 4, 6, exactly: the rate-2 kernel reads every second pixel, just what the strided row holds. The
# answers in between are there too, so a strided network can be made dense without new weights. Seven of 13 count: an
# output in an even column reads even columns, which read even columns. With rates 1, 2, 4 all 15 pixels of the field
# count.
#
# </details>
#
# $$ \text{kernel} \ast_{\text{rate } 2} \text{in}\;\Big|_{\text{every second}} \;=\;
#    \text{kernel} \ast_{\text{rate } 1} \left(\text{in}\;\Big|_{\text{every second}}\right) $$

# %% tags=["atrous"] jupyter={"outputs_hidden": true}
image, kernel = rng.normal(size=(16, 24)), rng.normal(size=(3, 3))
strided = convolve(image[::2, ::2], kernel)
np.testing.assert_allclose(convolve(image, kernel, rate=2)[::2, ::2], strided)


def paths_of(rates):
    """Return in how many ways the middle output depends on each pixel, (19, 19)."""
    paths = np.zeros((19, 19))
    paths[9, 9] = 1
    for rate in rates:
        paths = convolve(paths, np.ones((3, 3)), rate=rate)
    return paths


for rates in ((1, 1, 1), (2, 2, 2), (1, 2, 4)):
    columns = np.flatnonzero(paths_of(rates)[9])
    print(f"rates {rates}: field {np.ptp(columns) + 1} columns, {len(columns)} of them count")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three squares of pixels that an output depends on: rates 1 1 1 a full square of 7, rates 2 2 2 a lattice of 7 by 7 dots with holes over 13, rates 1 2 4 a full square of 15"
fig, axes = plt.subplots(1, 3, figsize=(9, 2.8), layout="constrained")
for ax, rates in zip(axes, ((1, 1, 1), (2, 2, 2), (1, 2, 4)), strict=True):
    paths = paths_of(rates)
    shown = ax.imshow(np.where(paths > 0, paths, np.nan), cmap="viridis", extent=(-9.5, 9.5, 9.5, -9.5))
    fig.colorbar(shown, ax=ax, shrink=0.7, label="ways" if ax is axes[-1] else None)
    ax.set(title=f"rates {rates}", xlabel="columns to the right [pixels]")
axes[0].set_ylabel("rows down [pixels]")
plt.show()

# %% [markdown]
# The output in the middle depends on the coloured pixels, in more ways where brighter (own scales). In the middle picture
# these are 7 · 7 of 13 · 13; the others are never looked at (*gridding*). The other price is computing time, since each
# map keeps all its pixels. So DeepLab compromises: it halves three times, goes atrous for the rest, and scores every
# eighth pixel. At its end four kernels of different rates look at one map, and their scores are summed. (A single one
# of the four needn't be right by itself, because training asked only for the sum.)
#
# ## One post, six ways back
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
# **Predict before you run.** A bright post, 1 on a ground of 0, one pixel wide, in columns 8, 9, 10, 11. Which ways say
# in which column it stands? Which keep it one pixel wide?
#
# <details><summary>Answer</summary>
#
# Indices, skips and atrous find the column, all four times; nearest and bilinear make one picture of the four; strided
# is right in column 8, and in column 10 only because its top is flat from 8 to 12, with 10 as the mean. Only the indices
# keep the width: skips make it two, atrous five.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}


def posts(column, width=1, height=16):
    """Return a dark picture with a bright post, (16, 24)."""
    image = np.zeros((height, 24))
    image[2:14, column : column + width] = 1
    return image


print("brightest column / columns at least half as bright")
print("post in column  ", *(f"{way:>10}" for way in MECHANISMS))
for column in (8, 9, 10, 11):
    found = [place_and_width(apply_mechanism(posts(column), way).max(axis=0)) for way in MECHANISMS]
    print(f"{column:14}  ", *(f"{place:5g} / {width:2d}" for place, width in found))

# %% [markdown]
# Play with it: move the post, and make it wider. (Without a running kernel
# there are no dials; the animation at the top shows a thin and a thicker post.) The orange band is where it truly stands.


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="a post and what six ways make of it, each as a picture above and as bars of brightness below, with the true place as an orange band"
def draw_ways(column, width):
    """Draw a post, and what each way makes of it."""
    image = posts(column, width)
    _, axes = plt.subplots(2, 7, figsize=(8.6, 2.4), layout="constrained", sharex=True, height_ratios=(1, 0.8))
    pictures = {"the post": image, **{way: apply_mechanism(image, way) for way in MECHANISMS}}
    for (above, below), (name, picture) in zip(axes.T, pictures.items(), strict=True):
        above.imshow(picture, cmap="magma", vmin=0, vmax=1)
        above.set_title(name, fontsize="medium")
        above.set(yticks=[])
        below.bar(range(24), picture.max(axis=0), width=1, color="0.3")
        below.axvspan(column - 0.5, column + width - 0.5, color="tab:orange", alpha=0.4, linewidth=0)
        below.set(ylim=(0, 1.05), xlabel="column", yticks=[0, 0.5, 1] if below is axes[1, 0] else [])
    axes[1, 0].set_ylabel("brightness")
    plt.show()


_ = interact(draw_ways, column=IntSlider(9, 4, 16), width=IntSlider(1, 1, 6))

# %% [markdown]
# ## The same, learnt
#
# Do learnt weights repair what the mechanism lost? Here are six networks of seven 3x3 convolutions, 3242 weights each.
# They start from the same numbers and see the same 600 pictures: a post one or two pixels wide beside a wall of the
# same brightness, in noise. They differ in one of the six mechanisms and in nothing else.
#
# **Predict before you run.** Order the six by how well they draw posts that they haven't seen (*intersection over
# union*, IoU: pixels that are post and called post, over pixels that are one or the other). Will the last of them catch
# up with twice as many steps?
#
# <details><summary>Answer</summary>
#
# Strided is last, then bilinear and nearest, then indices; skips and atrous are best. With twice the steps
# strided has gained, and its IoU stays below a half.
#
# </details>

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true, "outputs_hidden": true}
unseen, posts_of = draw_poles(100, seed=12345)
drawn, reached = {"image": unseen[:, 0], "truth": posts_of}, {}
print("              IoU [%]   rows missed [%]   width (truth) [pixels]   error in pixels")
for way in MECHANISMS:
    drawn[way] = train_pole_net(way)(unseen).detach().argmax(dim=1)
    got = reached[way] = score_poles(drawn[way], posts_of)
    width = f"{got.width:.1f} ({got.true_width:.1f})"
    print(f"{way:<11} {100 * got.iou:8.0f} {100 * got.missed:15.0f} {width:>23} {got.offset:18.2f}")
longer = score_poles(train_pole_net("strided", steps=300)(unseen).detach().argmax(dim=1), posts_of)
print(f"strided, 300 steps in place of 150: IoU {100 * longer.iou:.0f} %")
assert reached["strided"].iou < min(reached["nearest"].iou, reached["bilinear"].iou)
assert reached["indices"].iou < min(reached["skips"].iou, reached["atrous"].iou)
assert reached["strided"].iou < longer.iou < 0.5
assert sum(weights.numel() for weights in train_pole_net("atrous", steps=1).parameters()) == 3242

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three unseen pictures in rows, with truth and what the six networks draw: nearest and bilinear draw posts too wide, indices ragged or with gaps, skips and atrous whole posts, strided a block, a blob and one too short"
fig, axes = plt.subplots(3, 8, figsize=(8.8, 3.5), layout="constrained")
for row, k in zip(axes, (1, 2, 4), strict=True):
    for ax, (name, pictures) in zip(row, drawn.items(), strict=True):
        draw_image(pictures[k], ax=ax, cmap="gray" if name == "image" else "magma")
for ax, name in zip(axes[0], drawn, strict=True):
    ax.set_title(name, fontsize="medium")
plt.show()

# %% [markdown]
# Each row is one unseen picture; in the first column the thin bar is the post, the wide one the wall. (In the
# table a row is missed if no pixel of it is called post; the error is that of the post's middle.)
# The three ways that kept the column of the toy post are also the best three after learning (one training run each).
# Atrous computes more, because its maps keep all their pixels. Twice the steps didn't repair what strides had
# lost: after 300 of them the strided network is still behind what indices have after 150.
#
# ## A post of the drive
#
# The three trained networks of the course on a part of frame 14. They learnt from labelled images of other simulated
# streets.

# %% jupyter={"source_hidden": true} alt="five pictures of the sign and lamp post: A the image, B the true labels with a yellow sign on a thin yellow post and a yellow lamp post, C SegNet with a ragged yellow patch on the sign and hardly any on the lamp post, D FCN with yellow blobs on half of the sign and on the lower lamp post, E DeepLab with small yellow patches; no network draws the thin post"
with torch.inference_mode():
    called = {name: nets[name](as_input(images[NOW : NOW + 1]))[0].argmax(dim=0).numpy() for name in NAMES}
pictures = {"A: image": images[NOW], "B: truth": KITTI_14.colours(truths[NOW])}
pictures |= {
    f"{letter}: {NAMES[name]}": KITTI_14.colours(called[name]) for letter, name in zip("CDE", NAMES, strict=True)
}
fig, axes = plt.subplots(1, 5, figsize=(8.6, 3.8), layout="constrained")
for ax, (name, picture) in zip(axes, pictures.items(), strict=True):
    draw_image(picture[CROP], ax=ax).set_title(name, fontsize="medium")
shown = np.concatenate([labels[CROP] for labels in (truths[NOW], *called.values())])
legend_below(fig, shown)
plt.show()
for name, labels in called.items():
    right = (labels[CROP] == POST) & (truths[NOW][CROP] == POST)
    thin = right[22:62, 12:18]  # the sign's post alone
    print(
        f"{NAMES[name]}: {right.sum() / (truths[NOW][CROP] == POST).sum():.0%} of the pixels of sign and posts found",
        end="; ",
    )
    print(f"of the sign's post {thin.sum()} pixels of {(truths[NOW][CROP] == POST)[22:62, 12:18].sum()}")

# %% [markdown]
# No network draws the sign's post. And FCN, whose finest scores are at 1/8, finds more of sign and posts here than
# SegNet with its indices. So it isn't enough to keep *where*: a network must have learnt *what* as well. The
# [companion](deeper/07_trained_networks.ipynb) has the networks' tables, fields and failures.
#
# ## A real street
#
# The same three networks on a real image, from PandaSet. They have seen simulated streets only. Half of the image's
# pixels have a label, from LIDAR returns that people have labelled. Let us train on some of them: 24 steps of gradient
# descent, each on the *left* half of one of six frames. Then we judge two later frames, the left half and the right half
# apart. The vehicle moves by a decimetre only, so the left half of the later
# frames is nearly the image that was learnt; the right half is another part of the same street.
#
# **Predict before you run.** How will the accuracy change on the left half? On the right half? And if SegNet learns
# on the right half instead, what happens on the left?
#
# <details><summary>Answer</summary>
#
# The half that was learnt: all three networks reach about nine of ten labelled pixels. The other half: learning on
# the left, SegNet gains a little in pixel accuracy, while FCN and DeepLab lose a third; all three lose class accuracy.
# Learning on the right, SegNet falls from 81 to 30 % of the left half's pixels.
#
# </details>

# %% jupyter={"outputs_hidden": true}
street = real_drive()
real_images, real_truths = seen_by_networks([street[k] for k in range(10)])
halves = {"left": np.s_[..., :160], "right": np.s_[..., 160:]}
way = np.linalg.norm(street[9].T_world_from_lidar[:3, 3] - street[0].T_world_from_lidar[:3, 3])
print(f"{(real_truths != IGNORE).mean():.0%} of the pixels have a label; the vehicle has moved by {way:.1f} m")


def after_learning(name, half, steps=24):
    """Return an image network after some steps on one half of the first six frames."""
    net = load_net(sample_image_stage(name), street.camera).segmenter.train()
    x, labels = as_input(real_images)[halves[half]], torch.from_numpy(real_truths[halves[half]]).long()
    descent, chosen = torch.optim.SGD(net.parameters(), lr=0.02, momentum=0.9), np.random.default_rng(0)
    for _ in range(steps):
        k = [chosen.integers(6)]
        descent.zero_grad()
        F.cross_entropy(net(x[k]), labels[k], ignore_index=IGNORE).backward()
        descent.step()
    return net.eval()


# %% jupyter={"source_hidden": true}
@torch.inference_mode()
def judged(net):
    """Return the classes of the last two frames, and pixel and class accuracy of each half, in percent."""
    classes = net(as_input(real_images[8:])).argmax(dim=1).numpy()
    matrices = [confusion_matrix(real_truths[8:][half], classes[half], len(KITTI_14)) for half in halves.values()]
    return classes[1], np.array([[100 * pixel_accuracy(m), 100 * class_accuracy(m)] for m in matrices])


# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true, "source_hidden": true}
views = {name: {"before": judged(nets[name])} for name in NAMES}
for name in NAMES:
    views[name]["left"] = judged(after_learning(name, "left"))
views["segnet"]["right"] = judged(after_learning("segnet", "right"))
print(f"{'pixel / class accuracy [%]':<27}{'left half':>12}{'right half':>14}")
for name, view in views.items():
    for when, (_, shares) in view.items():
        learnt = "before" if when == "before" else f"learnt {when}"
        print(f"{NAMES[name]:<11} {learnt:<15}" + "".join(f"{p:8.0f} /{c:3.0f}" for p, c in shares))
for view in views.values():
    before, left = (view[key][1] for key in ("before", "left"))  # rows: halves; pixel, class accuracy
    assert left[0, 0] > max(85, before[0, 0])
lost = {name: view["before"][1][1] - view["left"][1][1] for name, view in views.items()}  # pixel, class accuracy
assert [name for name in NAMES if lost[name][0] > 0] == ["fcn", "deeplab"]
assert min(of_classes for _, of_classes in lost.values()) > 5
assert views["segnet"]["right"][1][0, 0] < 50 < views["segnet"]["before"][1][0, 0]

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="a real street in a grid of pictures: A the image, B its labelled points with a line through the middle, then for SegNet, FCN and DeepLab the classes before (C, E, G) and after (D, F, H) learning from the left half: before, road and cars are roughly there with many wrong patches; after, the left half agrees with the points"
fig, axes = plt.subplots(4, 2, figsize=(8.6, 5.9), layout="constrained")
draw_image(real_images[9], ax=axes[0, 0]).set_title("A: image", fontsize="medium")
draw_image(KITTI_14.colours(real_truths[9]), ax=axes[0, 1])
axes[0, 1].set_title("B: labelled points; those on the left teach", fontsize="medium")
letters = iter("CDEFGH")
for row, (name, view) in zip(axes[1:], views.items(), strict=True):
    for ax, when in zip(row, ("before", "left"), strict=True):
        draw_image(KITTI_14.colours(view[when][0]), ax=ax)
        text = f"{next(letters)}: {NAMES[name]}, {'before' if when == 'before' else 'after the left half'}"
        ax.set_title(text, fontsize="medium")
for ax in axes.flat:
    ax.axvline(159.5, color="black", linewidth=1, linestyle=":")
legend_below(fig, views["segnet"]["before"][0])
fig.suptitle(street.credit, fontsize=8)
plt.show()

# %% [markdown]
# The dotted line is the middle. Before, the networks have seen simulated streets only, and call more than half of the
# labelled pixels right in each half. After 24 steps the left half mostly agrees with its points. On the right half
# SegNet has gained pixel accuracy, too; but all three have lost class accuracy, and FCN and DeepLab both: they call
# the trees *building* (F, H). To fit the view that is learnt better than the street is
# **overfitting**. If you judge a network on
# the frames that it learnt, you measure its memory. Lecture [13](13_real_drive.ipynb) comes back to it.
#
# ## Where this breaks
#
# **A post beside a brighter wall.** An index can only say where the *largest* value of a window was. Give the post a
# brighter wall in the same windows; and pool and unpool a smooth slope, which has no thin thing in it, in the same way:

# %% jupyter={"source_hidden": true} alt="three pairs of pictures, before and after pooling and unpooling: A a post becomes a dotted line; B a post beside a brighter wall disappears; C a smooth slope becomes dots on a lattice"
post = np.zeros((8, 8))
post[:, 5] = 1
wall, slope = post.copy(), np.tile(np.arange(8) / 4, (8, 1))
wall[:, :5] = 2
fig, axes = plt.subplots(1, 6, figsize=(8.6, 1.9), layout="constrained")
names = ("A: post", "B: wall and post", "C: slope")
for pair, name, image in zip(axes.reshape(3, 2), names, (post, wall, slope), strict=True):
    draw_image(image, ax=pair[0], cmap="magma", vmin=0, vmax=2).set_title(name, fontsize="medium")
    back = unpool(*max_pool(image), image.shape)
    draw_image(back, ax=pair[1], cmap="magma", vmin=0, vmax=2).set_title("there and back", fontsize="medium")
plt.show()

# %% [markdown]
# A: the post becomes a dotted line. B: it is gone, because each of its windows has a brighter pixel. C: a smooth slope
# comes back as dots on a lattice. The convolutions that follow have to smooth it.
#
# **The edge that was cut.** A soft-max per pixel doesn't keep neighbours together: SegNet's labels of the drive have
# specks and gaps (picture C of the drive's post). Those of FCN and DeepLab are smooth, because they enlarge coarse
# scores.
#
# ## The ledger

# %% jupyter={"source_hidden": true}
Markdown(ledger_table(ledger("network")))

# %% [markdown]
# ## In five lines
#
# 1. A network gives scores; soft-max and cross-entropy teach it, by probability minus truth.
# 2. Scores go to the planes, not probabilities, and their zero says "nobody looked".
# 3. To see far, halve: a layer adds (kernel - 1) · rate · jump to the field. What is lost is *where*.
# 4. Indices put maxima back and lose what was second; skips give back what their finest map holds; atrous layers lose
#    no place, cost time, and may leave gaps in what they see.
# 5. A soft-max per pixel cuts the edge between neighbours: 0.27 instead of 0.66 in the gap of a post.
#
# **What you can now do**: look at the borders in a segmentation and guess which mechanism drew them; put a network
# of your own before the planes; and find out whether it has learnt a street or a view.
#
# ## Further reading
#
# - Long, Shelhamer, Darrell, *Fully convolutional networks for semantic segmentation*, CVPR 2015: FCN and its skips.
# - Badrinarayanan, Kendall, Cipolla, *SegNet: a deep convolutional encoder-decoder architecture for image
#   segmentation*, PAMI 39(12), 2017: pooling indices.
# - Chen, Papandreou, Kokkinos, Murphy, Yuille, *DeepLab: semantic image segmentation with deep convolutional nets,
#   atrous convolution, and fully connected CRFs*, PAMI 40(4), 2018.
# - Wang, Chen, Yuan, Liu, Huang, Hou, Cottrell, *Understanding convolution for semantic segmentation*, WACV 2018:
#   gridding, and rates against it.
#
# ## Exercise
#
# [Exercise 07](exercises/07_segmentation.ipynb): the shortest chain that sees everything, pooling with overlap and the
# way back, a whole layer with holes, which mechanism a black box has, a loss with four mistakes, and one question. Next:
# lecture [08](08_fusion.ipynb), from planes to the semantic grid.
