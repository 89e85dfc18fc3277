# %% [markdown]
# # 07 · Three networks for segmentation
#
# **In one sentence.** To name a pixel, a network must see far around it and still know exactly where it is; you build
# the parts of SegNet, FCN and DeepLab by hand, each with its own answer to this, and learn how to judge them.
#
# **You will be able to**
# - compute a convolution, a soft-max, a loss and one step of a kernel by hand;
# - read the shapes of a network, and say how far one pixel sees;
# - unpool by indices, add a skip and convolve with holes on a few numbers;
# - test a claim about an architecture with a control, over several seeds;
# - name the fault that each of three metrics can't see, and say when a metric measures memory.
#
# **Prerequisites.** Lecture [06](06_planes.ipynb): a loss, one step of descent, bilinear sampling. You need no deep
# learning.
#
# **Time.** 74 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.1, which names the three networks, and 4.1 for ImageNet.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from ipywidgets import FloatSlider, interact

from semgrid_edu import metrics, networks, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.labels import KITTI_14
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
# A network sees an image smaller and smaller. In the figure below, A shows the labels of a road sign and a lamp post of
# our drive. The sign's post is one or two pixels wide. Halve the picture twice, and bring it back to full
# size. In B each value of the small picture fills 4 x 4 pixels; C and D are ways back that you will build. Watch what
# happens while the street moves to the right, one pixel at a time.

# %% jupyter={"source_hidden": true} alt="animation with four panels: A, a sign on a thin post and a lamp post move to the right; B, halved twice, the posts are wide and move in jumps of four pixels; C, indices, the posts are dotted lines in the right place; D, a skip from half the size, the posts are bright but soft, and move in jumps of two pixels"
thing = (truths[3] == lecture_07_pictures.SIGNAGE).astype(float)
titles = {"A: truth": None, "B: halved twice": "nearest", "C: with indices": "indices", "D: with a skip": "half skips"}


def moving():
    """Yield the figure for each shift of the sign and the post."""
    fig, axes = plt.subplots(1, 4, figsize=(6.4, 3.2), layout="constrained")
    for shift in range(5):
        picture = np.roll(thing, shift, axis=1)[SIGN]
        for ax, (title, way) in zip(axes, titles.items(), strict=True):
            shown = picture if way is None else lecture_07_thin_pole.apply_mechanism(picture, way)
            if shift == 0:
                draw_image(shown, ax=ax, cmap="magma", vmin=0, vmax=1).set_title(title, fontsize=10)
            ax.images[0].set_data(shown)
        yield fig
        fig.set_layout_engine("none")  # the first frame has found its places


plotting.animate(moving(), period=0.6, alt="a thin post moves by single pixels and is brought back in three ways")

# %% [markdown]
# In B the post is wide and moves in jumps of four pixels: its exact place is lost. C has the right place, but only a
# dotted line. D adds the picture that was halved once, and moves in jumps of two. C is SegNet's idea, D that of FCN.
# DeepLab has a third: it halves less. Why halve at all? First we need to know what a layer sees.
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
# **stride** 2 it computes every second one. And the kernel's numbers may be spread: with *rate* 2 they are two pixels
# apart.
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
# sum. All these numbers are the layer's *weights*. And to each map it adds one number more, the *bias*. In short, a
# convolution answers where nine pixels look like its kernel. Who chooses the kernel?
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
# P           0.114    0.844    0.042
# ```
#
# Lecture 06 went down a loss step by step: a number that says how wrong we are. Here it is the **cross-entropy**, minus
# the logarithm of the true class's probability. If the pixel is a post, it is $-\log 0.844 = 0.17$. If it is road, it
# is $-\log 0.114 = 2.17$.
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}}, \qquad \text{loss} = -\log P(c^*), \qquad
#    \frac{\partial\,\text{loss}}{\partial s_c} = P(c) - [c = c^*] $$
#
# ($s_c$: the score of class $c$; $c^*$: the true class; $[\ldots]$ is 1 if true, else 0.)
#
# So the slopes are *probability minus truth*. If the pixel is a post, a step against them raises the score of *post*,
# and lowers the two others. Adding the same to all scores changes nothing, because it cancels.


# %% tags=["segmentation"]
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
# But descent must move *weights*. A weight multiplies one input, and adds the product to a score. So by the chain rule
# its slope is the score's slope times that input, summed over all pixels. By hand, on the row of above: a kernel of
# zeros makes the score of *post*, *ground* always scores zero, so each P is a half. Posts are rare, so let a post's
# pixel count four times:
#
# ```
# row                      0    0    1    0    0    1    1    0
# slope of the score      .5   .5   -2   .5   .5   .5   .5   .5
# times left neighbour     0    0    0   .5    0    0   .5   .5      sum  1.5
# times pixel itself       0    0   -2    0    0   .5   .5    0      sum -1
# times right neighbour    0   .5    0    0   .5   .5    0    0      sum  1.5
# ```
#
# Only the middle grows: one step makes the kernel -1.5, 1, -1.5, almost our detector of thin things.


# %%
row = torch.tensor([0.0, 0, 1, 0, 0, 1, 1, 0])
kernel = torch.zeros(1, 1, 3, requires_grad=True)
score = F.conv1d(row[None, None], kernel, padding=1)[0, 0]
both = torch.stack([torch.zeros(8), score], dim=1)  # ground, post
F.cross_entropy(both, (torch.arange(8) == 2).long(), torch.tensor([1.0, 4]), reduction="sum").backward()
print("slopes of the kernel:", kernel.grad[0, 0].numpy())
np.testing.assert_allclose(kernel.grad[0, 0], [1.5, -1, 1.5])

# %% [markdown]
# Now many steps, for the smallest network there is: one convolution with two kernels, one for the score of *pole* and
# one for that of *ground*. It sees noisy pictures of a pole, one or two pixels wide, beside a wall of the same
# brightness. Each step takes four new pictures, and a pole's pixel counts four times again.


# %%
def train(layer, steps, step_size, pole_weight=4.0):
    """Change the weights of a layer by gradient descent on pictures of poles."""
    pictures, truth = lecture_07_thin_pole.draw_poles(4 * steps, seed=0)
    for picture, labels in zip(pictures.split(4), truth.split(4), strict=True):
        loss = F.cross_entropy(layer(picture), labels, weight=torch.tensor([1.0, pole_weight]))
        slopes = torch.autograd.grad(loss, list(layer.parameters()))
        with torch.no_grad():
            for weights, slope in zip(layer.parameters(), slopes, strict=True):
                weights -= step_size * slope


torch.manual_seed(0)
layer = torch.nn.Conv2d(1, 2, 3, padding=1)  # from 1 channel to 2, 3x3, random weights and biases
train(layer, steps=300, step_size=2.0)
learned = (layer.weight[1] - layer.weight[0])[0].detach()
print("kernel of pole minus ground:", *learned.numpy().round(1), sep="\n")
print(f"bias: {layer.bias[1] - layer.bias[0]:.1f}")

# %% jupyter={"source_hidden": true}
unseen, posts = lecture_07_thin_pole.draw_poles(100, seed=12345)
unweighted = torch.nn.Conv2d(1, 2, 3, padding=1)
train(unweighted, steps=300, step_size=2.0, pole_weight=1.0)
thin_thing = F.conv2d(unseen, to_torch([[-1, 2, -1]] * 3).float(), padding=1)[:, 0]
with torch.no_grad():
    called = {"learned": layer(unseen).argmax(dim=1), "each pole counted once": unweighted(unseen).argmax(dim=1)}
    raised = unweighted(unseen) + torch.tensor([0, np.log(4)]).view(1, 2, 1, 1)
    called["the same, log 4 on the pole"] = raised.argmax(dim=1)
called["our -1 2 -1, best threshold"] = thin_thing > 1.75
called["never a pole"] = torch.zeros_like(posts)
print("                              IoU    pixel accuracy [%]")
for name, found in called.items():
    right = 100 * (found == posts).float().mean()
    print(f"{name:<28}{100 * lecture_07_thin_pole.overlap(found, posts):5.0f} {right:14.1f}")
one_layer = 100 * lecture_07_thin_pole.overlap(called["learned"], posts)
by_hand, *others = [100 * lecture_07_thin_pole.overlap(thin_thing > cut, posts) for cut in (1.75, 1.5, 2.0)]
assert (learned[:, 1] > 2).all()
assert (learned[:, [0, 2]] < -0.5).all()
assert learned.sum() > 2 > -4 > layer.bias[1] - layer.bias[0]
assert max(others) < by_hand < 25 < one_layer < 40
assert 100 * lecture_07_thin_pole.overlap(called["each pole counted once"], posts) < 15
assert 100 * lecture_07_thin_pole.overlap(called["the same, log 4 on the pole"], posts) > 25

# %% [markdown]
# Nobody told it, and yet each row rewards a bright middle and punishes bright neighbours, as our kernel does. But its
# numbers sum to more than zero: brightness counts, too, and the bias sets how much is needed.
#
# Judge it by *intersection over union* (IoU): pixels that are pole and called pole, over those that are one or the
# other. The learned kernel gets a third, ours less. If a pole's pixel counts once only, the layer hardly dares to say
# *pole*. Add log 4 to its score of *pole*, and it is nearly as good as the first: the weight in the loss has above all
# moved the threshold. Pixel accuracy is no judge of thin things: it gives "never a pole" 97 %.
#
# One thing this layer can never do: a pixel of a two-pixel pole has one bright and one dark neighbour, and so has the
# edge of a wall. Nine pixels can't tell these two apart.
#
# So descent finds useful kernels by itself. What one layer lacks is a wider view.
#
# ## How can a pixel see far?
#
# One 3x3 convolution sees three pixels a side: its **receptive field**, or field for short. A second one on top sees
# five. Now halve the map after the first. Its neighbours are then two image pixels apart, the *jump*, so each later
# layer adds twice as much. A layer adds (kernel - 1) · rate · jump:
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
SEES = {  # of a cell of the smallest map, as the networks are built
    "segnet": [CONV, CONV, HALVE, *2 * [CONV, HALVE], CONV, CONV, HALVE],
    "fcn": [*2 * [CONV, CONV, HALVE], *2 * [CONV, CONV, CONV, HALVE], CONV, CONV, HALVE, (7, 1, 1)],
    "deeplab": [(7, 2, 1), (3, 2, 1), CONV, CONV, (3, 2, 1), CONV, CONV, *4 * [(3, 1, 2)], (3, 1, 4), (3, 1, 8)],
}
SEES = {name: receptive_field(layers)[0] for name, layers in SEES.items()}
assert SEES == {"segnet": 64, "fcn": 372, "deeplab": 387}

# %% [markdown]
# To see 128 pixels without halving takes 64 layers at full size. With halving ten are enough, and the last of them are
# cheap. Halving is one cheap way to see far; DeepLab will show another. What does it cost? Take a row with a post of 1,
# and halve it twice: by the largest of two (*max-pooling*), by the mean of two, or by every second value (stride 2).
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
# Here is the whole SegNet that this course ships, *compact*: it has fewer channels than the published one. Each box is
# a map, with its channels, height and width. A network's way down is called its *encoder*, its way up its *decoder*.

# %% jupyter={"source_hidden": true} alt="SegNet as a row of ten boxes: an image of 3 x 96 x 320, maps of 16 x 96 x 320, 32 x 48 x 160, 48 x 24 x 80, 64 x 12 x 40 and 64 x 6 x 20 on the way down, then 48 x 12 x 40, 32 x 24 x 80, 16 x 48 x 160 and scores of 14 x 96 x 320 on the way up; red arrows carry indices from each level down to the same level up"
fig, ax = plt.subplots(figsize=(9.2, 2.9), layout="constrained")
lecture_07_drawn.draw_maps(
    lecture_07_drawn.draw_segnet(nets["segnet"], x[:1]),
    ax,
    f"SegNet, compact: a cell of the smallest map sees {SEES['segnet']} pixels a side",
)
plt.show()

# %% [markdown]
# A pixel of the smallest map stands for 16 x 16 pixels of the image, and has 64 channels to say *what* is there. The
# indices say *where*. They cost no weights.
#
# ## FCN: what do the finer maps say?
#
# FCN keeps no indices. It scores the classes on its coarsest map, doubles these scores by interpolation, and *adds*
# scores of a finer map: a **skip**. By hand, on a row of eight pixels; each number is the score of *post* minus that of
# everything else:
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
fig, ax = plt.subplots(figsize=(9.2, 2.66), layout="constrained")
lecture_07_drawn.draw_maps(
    lecture_07_drawn.draw_fcn(nets["fcn"], x[:1]),
    ax,
    f"FCN-8s, compact: a cell of the smallest map sees {SEES['fcn']} pixels a side",
)
plt.show()

# %% [markdown]
# A kernel of 1x1 reads one cell in all channels: that is how a map becomes scores. Coarse knows *what*, fine knows
# *where*; in our row neither alone is right, and their sum is. But the finest map that FCN adds has cells of 8 x 8
# pixels (hence *8s*). A skip is as exact as its finest map, and no more.
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
fig, ax = plt.subplots(figsize=(9.2, 2.23), layout="constrained")
lecture_07_drawn.draw_maps(
    lecture_07_drawn.draw_deeplab(nets["deeplab"], x[:1]),
    ax,
    f"DeepLab v2, compact: a cell of the smallest map sees {SEES['deeplab']} pixels a side",
)
plt.show()

# %% [markdown]
# Maps that keep their size cost time. So DeepLab compromises: it halves three times and goes atrous for the rest. At
# its end four kernels of different rates look at one map, and their scores are averaged. Such a cell sees more than the
# width of the image, as FCN's does; SegNet's sees a fifth.
#
# Now compare the ideas on posts of one, two and four pixels, without any learning:

# %% jupyter={"source_hidden": true} alt="what indices, skips and atrous kernels make of posts that are one, two and four columns wide, each as a picture above and as bars of brightness below, with the true places as orange bands: A, indices, dotted lines in one, one and two columns; B, skips up to half the size, soft posts that spread over the neighbouring columns; C, skips up to full size, bright posts at the right place within a faint, wide skirt; D, atrous, wide, blurred hills with their middle on the post"
lecture_07_pictures.draw_ways({5: 1, 13: 2, 22: 4})
plt.show()

# %% [markdown]
# Orange is the truth. Indices (A) keep the place in a dotted line, and not the width: where two pixels of a window are
# equal, only the first comes back. Skips as FCN's (B), whose finest map is smaller than the picture, keep the place to
# the cell of that map, here two pixels. Only a skip of full size (C, as in the network *U-Net*) has the post itself,
# with a fainter skirt. Atrous kernels without negative numbers (D) can only blur it. The rest has to be learned.
#
# ## Do strides lose what pooling keeps?
#
# By hand a stride lost the post in three columns of four, and max-pooling in none. "So networks should pool." Is that
# true of *learned* networks? Networks of seven convolutions look for the poles of above. One kind pools twice, another
# has stride 2 twice. *At once*: the small map is scored and interpolated to full size, as FCN and DeepLab end.
# *Decoder*: double and convolve, twice, as SegNet without its indices. *Skips*: this decoder also adds the maps of the
# way down, up to full size. *Atrous* stays at full size. All have the same number of weights.
#
# Each was trained five times beforehand, from different weights and on different pictures, in 1,200 steps of *Adam*, a
# descent that gives each weight its own step size.
#
# **Predict before you run.** Which matters more, pooling or stride, or the decoder?
#
# <details><summary>Answer</summary>
#
# The decoder. With it the strided networks gain more than forty points, and aren't behind the pooled ones.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="intersection over union of eight kinds of networks, a bar for the mean of five: pooling at once 57, strides at once 45, pooling with decoder 78, strides with decoder 87, pooling with skips 98, strides with skips 98, pooling with indices 93, atrous 99; diamonds for a quarter of the steps are lower, most of all with a decoder alone; a dashed line shows the single convolution at 32"
lecture_07_pictures.draw_reached(lecture_07_thin_pole.REACHED, lecture_07_thin_pole.SHORT, one_layer)
plt.show()

# %% jupyter={"source_hidden": true}
mean = {way: np.mean(overlaps) for way, overlaps in lecture_07_thin_pole.REACHED.items()}
assert mean["strides", "decoder"] > mean["strides", "at once"] + 40
assert mean["strides", "decoder"] > mean["pooling", "decoder"]
assert abs(mean["strides", "skips"] - mean["pooling", "skips"]) < 1
assert mean["pooling", "at once"] > mean["strides", "at once"] + 10
assert min(mean[down, "skips"] - mean[down, "decoder"] for down in ("pooling", "strides")) > 10
short = {way: np.mean(overlaps) for way, overlaps in lecture_07_thin_pole.SHORT.items()}
assert [round(m["strides", "skips"] - m["strides", "decoder"]) for m in (short, mean)] == [30, 11]
assert [round(m["pooling", "at once"] - m["strides", "at once"]) for m in (short, mean)] == [3, 12]
assert min(mean["strides", "skips"], mean["pooling", "indices"]) > mean["strides", "decoder"]

# %% [markdown]
# At once, strides do worse than pooling. We don't know why. With a decoder they are no worse. By hand a stride only
# dropped values, whereas a 3x3 kernel with stride 2 still reads every pixel. But no decoder alone gets everything back.
# Both kinds gain more than ten points when it also gets the finer maps, and then pooling or stride makes no difference.
# Atrous networks, which never halve, are as good.
#
# A short training can mislead both ways. After a quarter of the steps (diamonds) skips lead the strided decoder by 30
# points, at the end by 11; but at once, the lead of pooling *grows*.
#
# So with a decoder it matters less how you halve than what you hand over on the way up.
#
# ## What have the three learned?
#
# The three shipped networks learned from labelled images of other simulated streets. Here is the sign of our drive
# again, with the outlines of what is there: signage (solid) and a pedestrian (dashed).

# %% jupyter={"source_hidden": true} alt="four pictures of the sign, the lamp post and a small pedestrian with their true outlines: A the image; B SegNet, a ragged yellow patch on the sign and a red patch for pedestrian several times as wide as the pedestrian; C FCN, yellow on half of the sign and on the lower lamp post, a red patch beside the sign's post; D DeepLab, smaller yellow patches and a red one; no network draws the thin post"
with torch.inference_mode():
    scores = {NAMES[name]: net(x) for name, net in nets.items()}
classes = {name: found.argmax(dim=1).numpy() for name, found in scores.items()}
lecture_07_pictures.draw_signs(images[3], truths[3], {name: found[3] for name, found in classes.items()})
plt.show()

# %% [markdown]
# No network draws the sign's thin post, and all three see too much *pedestrian*. How good are they on five whole
# images? *Pixels* is pixel accuracy. *Classes* is class accuracy: the share of a class's true pixels that is found (its
# *recall*), averaged over classes. *IoU* is averaged over classes, too. The baseline looks at no image, but is an
# optimist: it knows the most frequent class of each row of *these* labels. The last columns are the recall of signage
# one or two pixels wide, and of signage five or wider.

# %% jupyter={"source_hidden": true}
PEDESTRIAN = lecture_07_pictures.PEDESTRIAN


def judge(classes):
    """Return in per cent pixel accuracy, class accuracy, mean IoU and pedestrian's IoU, and its calls per true one."""
    counts = metrics.confusion_matrix(truths, classes, 14)
    iou = metrics.class_iou(counts)
    found = metrics.pixel_accuracy(counts), metrics.class_accuracy(counts), np.nanmean(iou), iou[PEDESTRIAN]
    return np.append(100 * np.array(found), counts[:, PEDESTRIAN].sum() / counts[PEDESTRIAN].sum())


widths = lecture_07_pictures.widths_across(truths == lecture_07_pictures.SIGNAGE)
thin_sign, wide_sign = (widths > 0) & (widths < 3), widths > 4
rows = lecture_07_pictures.class_of_each_row(truths)
judged = {name: judge(found) for name, found in classes.items()}
baseline = np.broadcast_to(rows[:, None], truths.shape)
print("            pixels classes  IoU [%]   signage thin, wide [%]")
for name, found in (classes | {"baseline": baseline}).items():
    recalls = [100 * np.mean(found[there] == lecture_07_pictures.SIGNAGE) for there in (thin_sign, wide_sign)]
    print("{:<12}{:6.0f} {:7.0f} {:4.0f}  {:14.0f} {:7.0f}".format(name, *judge(found)[:3], *recalls))
    assert name == "baseline" or recalls[0] < 33 < 39 < recalls[1]
print(f"\npedestrian: {np.sum(truths == PEDESTRIAN)} pixels, called per true one:", end="")
print("".join(f" {name} {judged[name][4]:.1f}" for name in judged))

# %% [markdown]
# Each network misses at least two thirds of thin signage, and finds more of wide signage. This doesn't prove that
# halving is to blame: posts also look unlike boards.
#
# SegNet says *pedestrian* seven times as often as it should. Is its loss the cause? There a rare class counts up to
# four times, as our poles did. So try the cure of above backwards: take log 4 off the score of *pedestrian*. For
# comparison, forbid the class altogether: now the network is blind to pedestrians.
#
# **Predict before you run.** Which of the three metrics rises for the cure and falls for the blindness?
#
# <details><summary>Answer</summary>
#
# Only IoU. Pixel accuracy falls in neither case, because false calls vanish and pedestrians are few. Class accuracy
# falls in both, less for the cure, because recall doesn't count false calls.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for name, found in scores.items():
    for change, minus in (("log 4 off", np.log(4)), ("forbidden", np.inf)):
        changed = found.clone()
        changed[:, PEDESTRIAN] -= minus
        after = judge(changed.argmax(dim=1).numpy())
        gain = after - judged[name]
        print(f"{name:<11}{change}: pixels {gain[0]:+.1f}, classes {gain[1]:+.1f}, IoU {gain[2]:+.1f}; ", end="")
        print(f"pedestrian's IoU {judged[name][3]:.0f} -> {after[3]:.0f}")
        assert gain[0] > -0.2 > gain[1]
        assert (gain[2] > 0) == (change == "log 4 off")

# %% jupyter={"source_hidden": true}
BICYCLE = KITTI_14.index("bicycle")
for name, found in scores.items():
    changed = found.clone()
    changed[:, BICYCLE] -= np.log(4)
    ious = [
        metrics.class_iou(metrics.confusion_matrix(truths, one, 14))[BICYCLE]
        for one in (classes[name], changed.argmax(dim=1).numpy())
    ]
    print("{:<11}log 4 off bicycle: its IoU {:.0f} -> {:.0f}".format(name, *(100 * iou for iou in ious)))
    assert ious[1] < 0.6 * ious[0]
changed = scores["FCN-8s"].clone()
changed[:, PEDESTRIAN] -= np.log(4)
right = (changed.argmax(dim=1).numpy() == PEDESTRIAN) & (truths == PEDESTRIAN)
assert right.any(axis=(1, 2)).tolist() == [False, False, False, True, True]

# %% [markdown]
# In pixel accuracy a network that is blind to pedestrians is about as good as a cured one. IoU tells them apart,
# because it counts what is missed *and* what is called falsely. So before you trust a metric, know what it can't see,
# and how little it may rest on: FCN's cured pedestrians are all in two of the five images.
#
# Was the weight the cause? Bicycles are rare, too, so the same should help them. It doesn't: their IoU falls to about
# half, or far lower. So the weight isn't the whole cause.
#
# Move the slider. Where is SegNet's IoU highest, and from which value on is it lower than at zero?

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the sign and the pedestrian with their outlines, SegNet's classes as they are and with the slider's number off the score of pedestrian, and the three numbers"


def show(off):
    """Draw SegNet's classes with this much off the score of pedestrian."""
    changed = scores["SegNet"].clone()
    changed[:, PEDESTRIAN] -= off
    called = changed.argmax(dim=1).numpy()
    pictures = {"as it is": classes["SegNet"][3], f"{off:.1f} off": called[3]}
    fig = lecture_07_pictures.draw_signs(images[3], truths[3], pictures)
    fig.suptitle("SegNet: pixels {:.1f}, classes {:.1f}, IoU {:.1f} %".format(*judge(called)[:3]), fontsize=10)
    plt.show()


_ = interact(show, off=FloatSlider(value=1.4, min=0, max=4, step=0.2))

# %% [markdown]
# SegNet's IoU is highest at about 1.2, near log 4, and from about 2.4 on it is lower than at zero.
#
# ## What do ImageNet weights bring?
#
# The paper doesn't start from random weights. **Pretraining** means: learn another task first, for which labels are
# plenty, and go on from there. Here the first task was to name what is on a photograph (*ImageNet*).
#
# We gave a pretrained encoder a fresh decoder, and trained both on 24 images of a real street, in 100 steps. Only
# pixels that the LIDAR hit have a label. Four of the car's cameras teach, the two others test; three rounds leave out
# each camera once. The control has ImageNet's weights *shuffled* within each layer: the same numbers, the same step
# sizes, but no knowledge.

# %% jupyter={"source_hidden": true} alt="bars of pixel accuracy on cameras that weren't learned from, with intervals, and diamonds for the images learned from: ImageNet 82 (79 to 86) and 91; ImageNet shuffled 45 (38 to 52) and 80; fresh 65 (55 to 74) and 85; a dashed line at 41 for the class of each row"
lecture_07_pictures.draw_pretrained()
plt.show()
assert lecture_07_pretrained.ADDED == (17, 9, 25)
assert lecture_07_pretrained.LONGER == (65, 74)

# %% [markdown]
# Look at the shuffled network first. On the images that it learned from, 80 % of the pixels are right (diamond). On
# other cameras it can't be told from the rule that looks at no image. It has learned what holds for its images or its
# cameras, and little that holds elsewhere: **overfitting**. If you judge a network on what it learned from, you
# measure its memory.
#
# The pretrained network started from the same numbers in their right order, and reaches 82 %. So what ImageNet taught
# helps. Above fresh weights it gains 17 points, with an interval of 9 to 25 over the six cameras. That is one street
# and a short training. In another run, three times the steps brought fresh weights from 65 to 74 %.
#
# ## Where this breaks
#
# Move the image of the drive by one pixel. The labels should move along. Do they? We look far from the ends of a strip
# of three images.


# %%
def labels_that_move(net, shift, margin=200):
    """Return where the label moves along with the image, far from its borders, and the labels: (h, w) both."""
    width = wide.shape[3] - 64
    with torch.inference_mode():
        before, after = (net(wide[..., k : k + width]).argmax(dim=1)[0] for k in (0, shift))
    before = before[:, margin + shift : -margin]
    return before == after[:, margin : -margin - shift], before


wide = torch.cat(list(x[:3]), dim=2)[None]  # (1, 3, 96, 960)
moves = {name: labels_that_move(net, 1) for name, net in nets.items()}
for name, (along, _) in moves.items():
    print(f"moved by 1 pixel: {100 * along.float().mean():.0f} % of the labels of {NAMES[name]} move along")
for shift in (2, 4, 8, 16):
    along, _ = labels_that_move(nets["segnet"], shift)
    print(f"moved by {shift} pixels: {100 * along.float().mean():.0f} % of SegNet's")
assert along.all()

# %% jupyter={"source_hidden": true} alt="a street: A its image; B SegNet's labels; C the labels that don't move along in black; they form thin lines along the borders between classes"
along, labels = moves["segnet"]
middle = slice(320 - 201, 640 - 201)  # the second image; what is left begins in column 200 + 1 of the strip
lecture_07_pictures.draw_moves(images[1], labels.numpy(), along.numpy(), middle)
plt.show()
of_labels = labels[None].float()
at_border = (F.max_pool2d(of_labels, 5, 1, 2) != -F.max_pool2d(-of_labels, 5, 1, 2))[0]
print(
    f"within two pixels of a border between labels: {100 * at_border[~along].float().mean():.0f} % of the black ones,"
)
print(f"{100 * at_border.float().mean():.0f} % of all")
assert all(along.float().mean() < 0.96 for along, _ in moves.values())
assert at_border[~along].float().mean() > 0.9 > 0.5 > at_border.float().mean()

# %% [markdown]
# One in eight of SegNet's labels doesn't move along. The cause is the halving: after a shift of one pixel the windows
# hold other pixels. Test it: after 16 pixels, the side of SegNet's coarsest cell, all windows hold the same pixels as
# before, and every label moves along. Indices aren't the cause: FCN and DeepLab have none, and lose labels, too. At
# which shifts do *they* lose none? The exercise asks you.
#
# In C the lost labels form thin lines: nearly all are at a border between two labels. So edges tremble although the
# street is the same: a reason to believe no single frame, and to filter.
#
# ## In five lines
#
# 1. A convolution answers where nine pixels look like its kernel. Descent on the cross-entropy finds the kernel: a
#    weight's slope is probability minus truth, times its input.
# 2. To see far, halve: a layer adds (kernel - 1) · rate · jump to the field. What is lost is *where*.
# 3. Indices put maxima back, a skip is as exact as its finest map, atrous kernels see far without halving.
# 4. With the same decoder, strides are no worse than pooling for thin posts. What is handed over on the way up matters
#    more.
# 5. Pixel accuracy forgets rare classes, class accuracy forgives false calls, IoU counts both. On images that the
#    network learned from, each of them measures memory.
#
# ## Further reading and exercise
#
# - Long, Shelhamer, Darrell, *Fully convolutional networks for semantic segmentation*, CVPR 2015: FCN and its skips.
# - Badrinarayanan, Kendall, Cipolla, *SegNet*, PAMI 39(12), 2017: pooling indices.
# - Chen, Papandreou, Kokkinos, Murphy, Yuille, *DeepLab*, PAMI 40(4), 2018: atrous convolution.
# - Zhang, *Making convolutional networks shift-invariant again*, ICML 2019: labels that don't move along.
#
# [Exercise 07](exercises/07_segmentation.ipynb): chains, pooling, moving streets, black boxes and a loss to repair.
# Next: lecture [08](08_fusion.ipynb), from planes to the semantic grid.
