# %% [markdown]
# # 07 · Three networks for segmentation
#
# **In one sentence.** To name a pixel, a network must see far around it and still know exactly where it is; you build
# the parts of SegNet, FCN and DeepLab by hand, each with its own answer to this, and find out what else they need.
#
# **You will be able to**
# - compute a convolution, a soft-max, a loss and one step of learning by hand;
# - read the shapes of a network, and say how far one pixel sees;
# - unpool by indices, add a skip and spread a kernel on a few numbers;
# - test a claim about an architecture with an equal control, over several seeds;
# - say what pretraining brings, and when a score measures memory only.
#
# **Prerequisites.** Lecture [06](06_planes.ipynb): a loss, one step of descent, bilinear sampling. You need no deep
# learning.
#
# **Time.** 71 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.1, which names the three networks, and 4.1 for ImageNet.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from ipywidgets import IntSlider, interact

from semgrid_edu import metrics, networks, plotting
from semgrid_edu.datasets import samples
from worlds import lecture_07_drawn, lecture_07_pictures, lecture_07_pretrained, lecture_07_thin_pole

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"  # pixels stay pixels
torch.set_num_threads(1)
drive, rng = samples.sample_drive(), np.random.default_rng(0)
images, truths = lecture_07_pictures.small_frames(drive, range(2, 20, 4))
x = torch.from_numpy(images).permute(0, 3, 1, 2) / 255  # (frames, 3, 96, 320): what the networks take
NAMES = {"segnet": "SegNet", "fcn": "FCN-8s", "deeplab": "DeepLab v2"}
nets = {name: networks.load_net(samples.sample_image_stage(name), drive.camera).segmenter for name in NAMES}
draw_image, SIGN = lecture_07_pictures.draw_image, lecture_07_pictures.SIGN


def to_torch(array):
    """Return what PyTorch's layers take: (h, w) or (w,) -> (1, 1, h, w), double."""
    return torch.from_numpy(np.atleast_2d(np.asarray(array, float)))[None, None]


# %% [markdown]
# ## Why does a thin post disappear?
#
# A is a road sign and a lamp post of our drive, as the labels have them. The sign's post is one or two pixels wide. A
# network sees the image smaller and smaller. So take the picture, halve it twice, and bring it back to full size in
# three ways. Nothing is learned here. Watch what happens while the street moves to the right, one pixel a step.

# %% jupyter={"source_hidden": true} alt="animation with four panels: A, a sign on a thin post and a lamp post move to the right; B, enlarged, the posts are wide and move in jumps of four pixels; C, indices, the posts are dotted lines in the right place; D, skips, a sharp post within a faint, wider one"
thing = (truths[3] == lecture_07_pictures.SIGNAGE).astype(float)
titles = {"A: truth": None, "B: enlarged": "nearest", "C: with indices": "indices", "D: with skips": "skips"}


def moving():
    """Yield the figure for each shift of the sign and the post."""
    fig = plt.figure(figsize=(6.4, 3.2), layout="constrained")
    for shift in range(5):
        fig.clear()
        picture = np.roll(thing, shift, axis=1)[SIGN]
        for ax, (title, way) in zip(fig.subplots(1, 4), titles.items(), strict=True):
            shown = picture if way is None else lecture_07_thin_pole.apply_mechanism(picture, way)
            draw_image(shown, ax=ax, cmap="magma", vmin=0, vmax=1).set_title(title, fontsize=10)
        yield fig


plotting.animate(moving(), period=0.6, alt="a thin post moves by single pixels and is brought back in three ways")

# %% [markdown]
# In B the post is wide and moves in jumps of four pixels: its exact place is lost. C has the right place, but only a
# dotted line. D has a sharp post within a faint, wider one. C is the idea of SegNet, D that of FCN. DeepLab has a
# third: it halves less. Why would anybody make the image smaller? First we need to know what a layer sees.
#
# ## What does a convolution see?
#
# A row of eight pixels: a post one pixel wide, and a door two pixels wide. For every pixel, take twice its value and
# subtract its two neighbours. The three numbers -1, 2, -1 are a **kernel**:
#
# ```
# row                 0    0    1    0    0    1    1    0
# kernel -1 2 -1      0   -1    2   -1   -1    1    1   -1
# ```
#
# What is thin gets a 2, what is wider gets less. Set negative values to zero (*ReLU*), and you have a detector of thin
# things. In an image the kernel has 3 x 3 numbers, and moves over rows and columns. A layer may skip outputs: with
# **stride** 2 it computes every second one. And its numbers may be spread: with *rate* 2 they lie two pixels apart.
#
# $$ \text{out}[v, u] = \sum_{n=0}^{2} \sum_{m=0}^{2} \text{kernel}[n, m]\;
#    \text{in}[\text{stride}\, v + \text{rate}\, (n - 1),\; \text{stride}\, u + \text{rate}\, (m - 1)] $$


# %%
def convolve(image, kernel, stride=1, rate=1):
    """Return a 3x3 convolution of one channel; outside the image everything is zero."""
    h, w = image.shape
    padded = np.pad(image, rate)
    out = np.zeros((-(-h // stride), -(-w // stride)))
    for v, u in np.ndindex(out.shape):
        for n, m in np.ndindex(3, 3):
            out[v, u] += kernel[n, m] * padded[stride * v + rate * n, stride * u + rate * m]
    return out


# %% jupyter={"source_hidden": true}
picture, kernel = rng.normal(size=(9, 12)), rng.normal(size=(3, 3))
for stride, rate in ((1, 1), (2, 1), (1, 2), (3, 2)):
    by_torch = F.conv2d(to_torch(picture), to_torch(kernel), stride=stride, padding=rate, dilation=rate)
    np.testing.assert_allclose(convolve(picture, kernel, stride, rate), by_torch[0, 0], atol=1e-12)
thin = np.array([[0, 0, 0], [-1, 2, -1], [0, 0, 0]])
print(convolve(np.array([[0.0, 0, 1, 0, 0, 1, 1, 0]]), thin)[0])

# %% [markdown]
# A layer has many kernels, and each makes one map, a **channel**. The next layer's kernels run over all channels and
# sum. So a layer from 16 to 32 channels has 9 · 16 · 32 kernel numbers, its *weights*. So a convolution sees nine
# pixels, and answers where they look like its kernel. Who chooses the kernel?
#
# ## How does a network learn its weights?
#
# A network gives each pixel a **score** per class. To make probabilities of the scores, exponentiate and divide by the
# sum; that is the *soft-max*. By hand, for one pixel and three classes:
#
# ```
#              road     post     sky
# score          1        3        0
# exp(score)   2.72    20.09       1       sum 23.8
# P            0.11     0.84     0.04
# ```
#
# Lecture 06 went down a loss step by step: a number that says how wrong we are. Here it is the **cross-entropy**, minus
# the logarithm of the true class's probability. If the pixel is a post, it is $-\log 0.84 = 0.17$. If it is road, it is
# $-\log 0.11 = 2.17$.
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}}, \qquad \text{loss} = -\log P(c^*), \qquad
#    \frac{\partial\,\text{loss}}{\partial s_c} = P(c) - [c = c^*] $$
#
# ($s_c$: the score of class $c$; $c^*$: the true class; $[\ldots]$ is 1 if true, else 0.)
#
# **Predict before you run.** The pixel is a post. Which scores does one step of descent, of rate 1, raise, and to what?
# And what happens to the loss if you add 5 to all three scores?
#
# <details><summary>Answer</summary>
#
# The slopes are *probability minus truth*: 0.11, -0.16, 0.04. A step goes against them: 0.89, 3.16, -0.04. Only the
# true class rises. Adding 5 changes nothing, because $e^5$ cancels.
#
# </details>


# %% tags=["segmentation"] jupyter={"outputs_hidden": true}
def cross_entropy(scores, true):
    """Return -log P(true class) of one pixel; scores (C,)."""
    odds = np.exp(scores)
    return -np.log(odds[true] / odds.sum())


s = torch.tensor([1.0, 3.0, 0.0], dtype=torch.float64, requires_grad=True)
loss = F.cross_entropy(s[None], torch.tensor([1]))
loss.backward()  # fills s.grad with the slopes
after = (s - 1.0 * s.grad).detach().numpy()
print(f"loss {loss:.2f}, slopes {s.grad.numpy().round(2)}, after one step {cross_entropy(after, 1):.2f}")
np.testing.assert_allclose(cross_entropy(s.detach().numpy() + 5, 1), loss.item())

# %% [markdown]
# In a network the chain rule carries these slopes back from the scores to every weight, and the step moves the
# *weights*. Let us do that for the smallest network there is: one convolution with two kernels, one scores *pole* and
# the other *ground*. It sees noisy pictures of a pole, one or two pixels wide, beside a wall of the same brightness.
# Each step takes four new pictures. (A pole's pixel counts four times, because poles are rare.)


# %%
def train(layer, steps, rate):
    """Change the weights of a layer by gradient descent on pictures of poles."""
    pictures, truth = lecture_07_thin_pole.draw_poles(4 * steps, seed=0)
    for picture, labels in zip(pictures.split(4), truth.split(4), strict=True):
        loss = F.cross_entropy(layer(picture), labels, weight=torch.tensor([1.0, 4.0]))
        slopes = torch.autograd.grad(loss, list(layer.parameters()))
        with torch.no_grad():
            for weights, slope in zip(layer.parameters(), slopes, strict=True):
                weights -= rate * slope


torch.manual_seed(0)
layer = torch.nn.Conv2d(1, 2, 3, padding=1)  # from 1 channel to 2, 3x3, random weights
train(layer, steps=300, rate=2.0)
learned = (layer.weight[1] - layer.weight[0])[0].detach()
print("kernel of pole minus ground:", *learned.numpy().round(1), sep="\n")

# %% jupyter={"source_hidden": true}
unseen, posts = lecture_07_thin_pole.draw_poles(100, seed=12345)
with torch.no_grad():
    called = layer(unseen).argmax(dim=1)
one_layer = 100 * lecture_07_thin_pole.overlap(called, posts)
print(f"intersection over union on 100 new pictures: {one_layer:.0f} %")
print(f"pixel accuracy: {(called == posts).float().mean():.3f}; of 'never a pole': {(posts == 0).float().mean():.3f}")
assert (learned[:, 1] > 2).all()
assert (learned[:, [0, 2]] < -0.5).all()
assert 25 < one_layer < 40

# %% [markdown]
# Nobody told it, and yet each row of the learned kernel is our own, only larger. The layer is poor, though. Its
# *intersection over union* (pixels that are pole and called pole, over those that are one or the other) is about a
# third. The trivial rule "never a pole" gets nothing there, but 97 % in pixel accuracy, so don't judge thin things by that.
# One thing this layer can never do: a pixel of a two-pixel pole has one bright and one dark neighbour, and so has the
# edge of a wall. Nine pixels can't tell them apart.
#
# The paper hands the *scores* to the planes of lecture 06, not the probabilities. Say that *post* leads by 6 in
# one pixel and trails by 1 in the next. A point halfway between them gets a lead of 2.5, which is P = 0.92. If you
# interpolate the probabilities instead, you get 0.63. With scores the pixel that knows more counts more. And a point
# that no pixel shows gets zeros, so on the planes a score of zero means *nobody looked*.

# %% jupyter={"source_hidden": true}
leads = np.array([6.0, -1.0])
assert np.round(1 / (1 + np.exp(-leads.mean())), 2) == 0.92
assert np.round((1 / (1 + np.exp(-leads))).mean(), 2) == 0.63

# %% [markdown]
# So descent finds useful kernels by itself. What one layer lacks is a wider view.
#
# ## How can a pixel see far?
#
# One 3x3 convolution sees three pixels a side, its **receptive field**. A second one on top sees five. Now halve the map after
# the first. Its neighbours are then two image pixels apart, the *jump*, so each later layer adds twice as much. A layer
# adds (kernel - 1) · rate · jump:
#
# ```
# layer                     adds    field    jump after
# convolution                 2       3          1
# halving, 2x2                1       4          2
# convolution                 4       8          2
# convolution of rate 2       8      16          2
# ```


# %% tags=["receptive-field"]
def receptive_field(layers):
    """Return how many pixels a side one output sees, and how many pixels apart two outputs are."""
    field, jump = 1, 1
    for kernel, stride, rate in layers:
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field, jump


CONV, HALVE = (3, 1, 1), (2, 2, 1)  # kernel, stride, rate
print("64 convolutions, never halved:", receptive_field([CONV] * 64)[0], "pixels")
print("10 convolutions, halved after every second:", receptive_field(([CONV, CONV, HALVE] * 5)[:14])[0], "pixels")

# %% jupyter={"source_hidden": true}
assert receptive_field([CONV, HALVE, CONV, (3, 1, 2)]) == (16, 2)

# %% [markdown]
# To see 128 pixels without halving takes 64 layers at full size. With halving ten are enough, and the last of them are
# cheap. So networks halve because it is the cheap way to see far. What does it cost? Take a row with a post of 1, and halve it twice: by the largest of
# two (*max-pooling*), by the mean of two, or by every second value (stride 2).
#
# **Predict before you run.** The row has sixteen columns, the post is in column 8. Which four numbers are left, for
# each of the three ways? And with the post in one of the next three columns?
#
# <details><summary>Answer</summary>
#
# Max: zeros with a 1 in third place, in all four cases, so the place within the four is lost. Mean: a quarter in third
# place, so the strength is lost, too. Stride: the 1 for column 8, and for the others nothing at all.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for column in (8, 9, 10, 11):
    row = torch.eye(16)[column].view(1, 1, 16)
    by_max, by_mean = (pool(pool(row, 2), 2)[0, 0].numpy() for pool in (F.max_pool1d, F.avg_pool1d))
    print(f"column {column}: max {by_max}, mean {by_mean}, stride {row[0, 0, ::4].numpy()}")

# %% [markdown]
# Each halving loses one bit of *where* across, and one down. How do you get these bits back?
#
# ## SegNet: where was the maximum?
#
# Pool this map by windows of 2x2, and note for each maximum where it was, counting the map row by row from 0:
#
# ```
#  1  0 | 0  2                              0  0  0  2
#  0  3 | 0  0      maxima     indices      0  3  0  0
#  -----+-----       3  2        5   3      0  0  4  0
#  0  0 | 4  0       5  4       12  10      5  0  0  0
#  5  0 | 0  0
# ```
#
# On the way up each maximum goes back to its place, and the rest is zero: **unpooling**. The 1 in the corner was second
# in its window, so it is lost. The convolutions that follow have to fill the holes.
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


# %% jupyter={"source_hidden": true}
by_hand = np.array([[1.0, 0, 0, 2], [0, 3, 0, 0], [0, 0, 4, 0], [5, 0, 0, 0]])
for image in (by_hand, rng.normal(size=(6, 10))):
    pooled, indices = max_pool(image)
    values, places = F.max_pool2d(to_torch(image), 2, return_indices=True)
    np.testing.assert_array_equal(indices, places[0, 0])
    np.testing.assert_allclose(unpool(pooled, indices, image.shape), F.max_unpool2d(values, places, 2)[0, 0])

# %% [markdown]
# Here is the whole SegNet that this course ships. Each box is a map, with its channels, height and width. A network's
# way down is called its *encoder*, its way up its *decoder*.

# %% jupyter={"source_hidden": true} alt="SegNet as a row of ten boxes: an image of 3 x 96 x 320, maps of 16 x 96 x 320, 32 x 48 x 160, 48 x 24 x 80, 64 x 12 x 40 and 64 x 6 x 20 on the way down, then 48 x 12 x 40, 32 x 24 x 80, 16 x 48 x 160 and scores of 14 x 96 x 320 on the way up; red arrows carry indices from each level down to the same level up"
fig, ax = plt.subplots(figsize=(9.2, 2.9), layout="constrained")
lecture_07_drawn.draw_maps(lecture_07_drawn.draw_segnet(nets["segnet"], x[:1]), ax, "SegNet, compact")
plt.show()

# %% [markdown]
# A pixel of the smallest map stands for 16 x 16 pixels of the image, and has 64 channels to say *what* is there. The
# indices say *where*. They cost no weights.
#
# ## FCN: what do the finer maps say?
#
# FCN keeps no indices. It scores the classes on its coarsest map, doubles these scores by interpolation, and *adds*
# scores of a finer map: a **skip**. By hand, on a row of eight pixels; the lead of *post* over the rest:
#
# ```
# coarse, each for two pixels    -3        -3         3        -3
# enlarged                       -3   -3   -3  -1.5  1.5  1.5 -1.5  -3     something is there, some two pixels wide
# fine                           -2    2   -2   -2   -2    2   -2   -2     two thin lines: a crack in a wall, a post
# sum                            -5   -1   -5  -3.5 -0.5  3.5 -3.5  -5     one post, one pixel wide
# ```
#
# A coarse value belongs to the middle of its two pixels. So column 3 is a quarter of the way from the second to the
# third value, from -3 to 3, and gets -1.5.


# %% tags=["skips"]
def enlarge_row(scores, factor):
    """Enlarge: cell i covers pixels factor i .. factor (i + 1) - 1; beyond the outermost middles it stays constant."""
    middle = (np.arange(len(scores)) + 0.5) * factor - 0.5
    return np.interp(np.arange(len(scores) * factor), middle, scores)


coarse, fine = np.array([-3.0, -3, 3, -3]), np.array([-2.0, 2, -2, -2, -2, 2, -2, -2])
print("sum:", enlarge_row(coarse, 2) + fine)

# %% jupyter={"source_hidden": true} alt="FCN as a row of eleven boxes: an image of 3 x 96 x 320, five pooled maps from 16 x 48 x 160 to 64 x 3 x 10, one of 48 x 3 x 10, then scores of 14 x 3 x 10, 14 x 6 x 20, 14 x 12 x 40 and 14 x 96 x 320; red arrows add the scores of two finer maps to the scores of the same size"
fig, ax = plt.subplots(figsize=(9.2, 2.9), layout="constrained")
lecture_07_drawn.draw_maps(lecture_07_drawn.draw_fcn(nets["fcn"], x[:1]), ax, "FCN-8s, compact")
plt.show()

# %% [markdown]
# Coarse knows *what*, fine knows *where*; in our row neither alone is right, and their sum is. But the finest map that FCN adds has cells of 8 x 8
# pixels. A skip gives back what its finest map holds, and no more.
#
# ## DeepLab: must we halve at all?
#
# Halving does two things: the map gets fewer pixels, and the kernels see further. Only the second is wanted. So leave
# the stride out, and spread the kernel instead. That is an **atrous** convolution (French *à trous*, with holes):
#
# ```
# row                   0    0    0    1    0    0    0    0
# kernel 1 2 3, rate 1  0    0    3    2    1    0    0    0       sees 3 pixels
# kernel 1 2 3, rate 2  0    3    0    2    0    1    0    0       sees 5, with the same three weights
# ```
#
# **Predict before you run.** Keep every second column of the row, then convolve with rate 1. Which numbers of a
# convolution with rate 2 on the *whole* row are those? And put three layers of rate 2 on top of each other. Their field
# has 13 columns: how many of them count?
#
# <details><summary>Answer</summary>
#
# Exactly those of the columns that you kept, because the kernel of rate 2 reads every second pixel. The numbers in
# between are new. Seven of 13 count: an even column reads even columns, which read even columns. With growing rates, 1,
# 2, 4, all count.
#
# </details>

# %% tags=["atrous"] jupyter={"outputs_hidden": true}
picture, kernel = rng.normal(size=(16, 24)), rng.normal(size=(3, 3))
np.testing.assert_allclose(convolve(picture, kernel, rate=2)[::2, ::2], convolve(picture[::2, ::2], kernel))
for rates in ((2, 2, 2), (1, 2, 4)):
    columns = {0}
    for rate in rates:
        columns = {column + step for column in columns for step in (-rate, 0, rate)}
    print(f"rates {rates}: field {max(columns) - min(columns) + 1} columns, {len(columns)} of them count")

# %% jupyter={"source_hidden": true} alt="DeepLab as a row of eight boxes: an image of 3 x 96 x 320, then maps of 8 x 48 x 160, 32 x 24 x 80, 64 x 12 x 40, 128 x 12 x 40 and 256 x 12 x 40, scores of 14 x 12 x 40, and scores of 14 x 96 x 320; the last maps keep their size, with rates 2 and 4"
fig, ax = plt.subplots(figsize=(9.2, 2.5), layout="constrained")
lecture_07_drawn.draw_maps(lecture_07_drawn.draw_deeplab(nets["deeplab"], x[:1]), ax, "DeepLab v2, compact")
plt.show()

# %% [markdown]
# Maps that keep their size cost time. So DeepLab compromises: it halves three times and goes atrous for the rest. At
# its end four kernels of different rates look at one map, and their scores are summed. Now compare the three ideas on one post, without any learning:

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="a post and what indices, skips and atrous kernels make of it, each as a picture above and as bars of brightness below, with the true place as an orange band: indices a dotted line of the right width, skips twice as wide, atrous blurred over five columns, all in the right place"


def show(column, width):
    """Draw a post, and what each idea makes of it."""
    lecture_07_pictures.draw_ways(column, width)
    plt.show()


_ = interact(show, column=IntSlider(9, 4, 16), width=IntSlider(1, 1, 6))

# %% [markdown]
# All three keep the place of the post. Indices keep its width, too, but with gaps; skips and atrous kernels blur it. (The dials work with a running kernel.)
#
# ## Do strides lose what pooling keeps?
#
# By hand a stride lost the post in three columns of four, and max-pooling in none. "So networks should pool." Is that
# true of *learned* networks? Two networks of seven convolutions look for the poles of above. They have the same number
# of weights. One pools twice, the other has stride 2 twice. Both score at a quarter of the size, and the scores are enlarged at
# once. Then give each an equal decoder: double, convolve, double, convolve, score. Each network was trained five times
# beforehand, from different weights and on different pictures.
#
# **Predict before you run.** Which matters more, pooling or stride, or the decoder?
#
# <details><summary>Answer</summary>
#
# The decoder. With it the strided network gains more than twenty points, and isn't behind the pooled one.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="intersection over union of eight networks, five dots each and a bar for their mean: pooling at once 44, strides at once 41, pooling with decoder 57, strides with decoder 65, pooling with indices 85, strides with skips 95, pooling with skips 95, atrous 94; a dashed line shows the single convolution at 32"
lecture_07_pictures.draw_reached(lecture_07_thin_pole.REACHED, one_layer)
plt.show()

# %% jupyter={"source_hidden": true}
mean = {way: np.mean(overlaps) for way, overlaps in lecture_07_thin_pole.REACHED.items()}
assert mean["strides", "decoder"] > mean["strides", "at once"] + 20
assert mean["strides", "decoder"] > mean["pooling", "decoder"]
assert (
    abs(mean["strides", "skips"] - mean["pooling", "skips"]) < 1 < mean["pooling", "skips"] - mean["pooling", "indices"]
)

# %% [markdown]
# Scored at once, both are poor. With equal decoders the strided networks are no worse than the pooled ones. So the
# stride isn't to blame. Our row by hand only dropped values, whereas a 3x3 kernel with stride 2 still reads every pixel.
#
# The bars on the right show what does help. A decoder that gets indices or skips is told *where*, and with skips the
# network is equally good whether it pools or strides. The atrous network, which never halves, is as good. So it matters
# less how you halve than what you hand over on the way up.
#
# ## What have the three learned?
#
# The three shipped networks learned from labelled images of other simulated streets. Here they are on the sign of our drive:

# %% jupyter={"source_hidden": true} alt="four pictures of the sign and the lamp post: A truth, a yellow sign on a thin yellow post and a yellow lamp post beside a small pedestrian; B SegNet, a ragged yellow patch on the sign, none on the lamp post, much red for pedestrian; C FCN, yellow blobs on half of the sign and on the lower lamp post; D DeepLab, smaller yellow patches; no network draws the thin post"
with torch.inference_mode():
    scores = {name: net(x) for name, net in nets.items()}
classes = {name: found.argmax(dim=1).numpy() for name, found in scores.items()}
lecture_07_pictures.draw_signs(truths[3], {NAMES[name]: found[3] for name, found in classes.items()})
plt.show()

# %% [markdown]
# No network draws the sign's thin post. How good are they on whole images? *Signage found* is the share of its true
# pixels that are called signage (*recall*), *right* the share of those called so that are (*precision*). The baseline
# looks at no image: it knows the most frequent class of each row, even from these very frames.

# %% jupyter={"source_hidden": true}
matrices = {NAMES[name]: metrics.confusion_matrix(truths, found, 14) for name, found in classes.items()}
rows = lecture_07_pictures.class_of_each_row(truths)
matrices["baseline"] = metrics.confusion_matrix(truths, np.broadcast_to(rows[:, None], truths.shape), 14)
print("              pixels  classes   signage found, right [%]")
for name, m in matrices.items():
    sign = m[lecture_07_pictures.SIGNAGE], m[:, lecture_07_pictures.SIGNAGE]
    found, right = (one[lecture_07_pictures.SIGNAGE] / max(one.sum(), 1) for one in sign)
    shares = metrics.pixel_accuracy(m), metrics.class_accuracy(m), found, right
    print(f"{name:<12}" + "".join(f"{100 * share:9.0f}" for share in shares))

# %% [markdown]
# In pixel accuracy three points lie between the networks, one training run each, so this doesn't rank them. But *pixels* hides something. Forbid each
# network to say signage, pedestrian or bicycle:

# %%
small = [lecture_07_pictures.KITTI_14.index(name) for name in ("signage", "pedestrian", "bicycle")]
for name, found in scores.items():
    blind = found.clone()
    blind[:, small] = -torch.inf
    m = metrics.confusion_matrix(truths, blind.argmax(dim=1).numpy(), 14)
    gain = [
        100 * (score(m) - score(matrices[NAMES[name]])) for score in (metrics.pixel_accuracy, metrics.class_accuracy)
    ]
    print(f"{NAMES[name]:<11} blind to small things: pixels {gain[0]:+.1f}, classes {gain[1]:+.0f} points")
    assert gain[0] > 0.5
    assert gain[1] < -8

# %% [markdown]
# A network that sees no pedestrian is *better* in pixel accuracy. *Class accuracy*, the mean recall of all classes,
# sees the loss. So the three find large things well and thin ones badly, and you need both numbers to notice.
#
# ## What do ImageNet weights bring?
#
# The paper doesn't start from random weights. **Pretraining** means: learn another task first, for which labels are
# plenty, and go on from there. Here the first task is to name what is on each of 1.3 million photographs (*ImageNet*).
# Then the last layer is replaced by a decoder, and the network learns our labels.
#
# We took a pretrained encoder, EfficientNet-Lite0, and a decoder that adds maps of five sizes, as FCN adds skips. The
# street is real (PandaSet, six cameras). The network learned from 24 labelled images of four cameras, in 100 steps, and
# is scored on the two other cameras; three rounds leave out each camera once. A control has ImageNet's weights
# *shuffled* within each layer: the same numbers in another order, so it knows nothing.
#
# **Predict before you run.** "From ImageNet 46 % of the pixels are right, from fresh weights 65 %. So pretraining harms."
# The shuffled weights reach 48 %. Which suspect does the control leave?
#
# <details><summary>Answer</summary>
#
# Not the knowledge: without it the same weights do as badly. What both have in common is the *size* of their weights.
#
# </details>
#
# Indeed the pretrained encoder's maps are three to seven times as large as fresh ones. The decoder normalises what comes
# up from the coarser maps, but adds the next finer map as it is. So the finest map, which has seen least, drowns the
# others. If this is the cause, then normalising each map before it is added (subtract its mean, divide by its spread:
# *batch normalisation*) must change the picture:

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two bar charts of pixel accuracy on other cameras; A, maps as they are: ImageNet 46, shuffled 48, fresh 65; B, each map normalised: ImageNet 82, shuffled 45, fresh 65; a dashed line for the class of each row at 41"
lecture_07_pictures.draw_pretrained()
plt.show()
assert lecture_07_pretrained.AS_IT_IS == (46, 48, 65)
assert lecture_07_pretrained.NORMALISED[0] - lecture_07_pretrained.AS_IT_IS[0] == 36
assert (lecture_07_pretrained.ADDED, lecture_07_pretrained.LONGER) == ((17, 9, 25), 74)
assert lecture_07_pretrained.OWN == {2: 92, 8: 87, 24: 86}
assert lecture_07_pretrained.OTHERS == {2: 57, 8: 64, 24: 65}

# %% [markdown]
# Only the pretrained network changes its place. It gains 36 points and is now 17 above the fresh one (9 to 25, an
# interval over cameras). The shuffled one stays near the baseline, so what helps is what ImageNet taught. Is the fresh
# network just slow? With three times the steps, maps as they are, it reaches 74 %, still less. That is one street and one training in each round.
#
# How much of a score is memory? Judge the fresh network also on the very images that it learned from:
#
# ```
# labelled images               2     8    24
# right on these images  [%]   92    87    86
# right on other cameras [%]   57    64    65
# ```
#
# The gap is **overfitting**: the network fits the images that it learned from better than the street. It shrinks with
# more images. If you judge a network on what it learned from, you measure its memory. So pretraining brings knowledge, if the decoder can
# use it, and only images that nobody learned from can tell.
#
# ## Where this breaks
#
# Move the image of the drive by one pixel. SegNet should give the same labels, moved by one pixel. Does it?

# %%
wide = torch.cat(list(x[:4]), dim=2)[None]  # four images side by side, (1, 3, 96, 1280)


def labels_that_move(net, shift, margin=300):
    """Return the share of pixels whose label moves along with the image, far from its borders."""
    width = wide.shape[3] - 64
    with torch.inference_mode():
        before, after = (net(wide[..., k : k + width]).argmax(dim=1) for k in (0, shift))
    return (before[..., margin + shift : -margin] == after[..., margin : -margin - shift]).float().mean().item()


moved = {shift: labels_that_move(nets["segnet"], shift) for shift in (1, 8, 16)}
for shift, share in moved.items():
    print(f"moved by {shift:2d}: {100 * share:5.1f} % of SegNet's labels move along")
of_deeplab = labels_that_move(nets["deeplab"], 1)
print(f"DeepLab, moved by 1: {100 * of_deeplab:.1f} %")

# %% jupyter={"source_hidden": true}
assert moved[1] < 0.9 < moved[16] == 1
assert of_deeplab < 0.95

# %% [markdown]
# One label in eight doesn't move along. The cause is the halving: after a shift of one pixel the windows hold other
# pixels. Switch it off: after 16 pixels, the side of SegNet's coarsest cell, all windows hold the same pixels as before,
# and every label moves along. It isn't the indices, because DeepLab has none and halves, too.
#
# So a label may change although nothing in the street has. That is a reason to believe no single frame, and to filter.
#
# ## In five lines
#
# 1. A convolution answers where nine pixels look like its kernel. Descent on the cross-entropy finds the kernel, by
#    probability minus truth.
# 2. To see far, halve: a layer adds (kernel - 1) · rate · jump to the field. What is lost is *where*.
# 3. Indices put maxima back, skips add what finer maps say, atrous kernels see far without halving.
# 4. Strides aren't to blame for thin posts: with an equal decoder they are no worse than pooling.
# 5. Pretraining brings much where labels are few, if the decoder can use it. Score on images that nobody learned from.
#
# ## Further reading and exercise
#
# - Long, Shelhamer, Darrell, *Fully convolutional networks for semantic segmentation*, CVPR 2015: FCN and its skips.
# - Badrinarayanan, Kendall, Cipolla, *SegNet*, PAMI 39(12), 2017: pooling indices.
# - Chen, Papandreou, Kokkinos, Murphy, Yuille, *DeepLab*, PAMI 40(4), 2018: atrous convolution.
# - Tan, Le, *EfficientNet*, ICML 2019: the encoder of the last experiment.
# - Zhang, *Making convolutional networks shift-invariant again*, ICML 2019: why labels flicker.
#
# [Exercise 07](exercises/07_segmentation.ipynb): the shortest chain that sees everything, pooling with overlap and the
# way back, how far a real network's labels move along, which mechanism a black box has, a loss with four mistakes, and
# one question. Next: lecture [08](08_fusion.ipynb), from planes to the semantic grid.
