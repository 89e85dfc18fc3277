# %% [markdown]
# # 11 · The fast CRF: pairs become filters
#
# **In one sentence.** Mean field asks every cell about every other one; that sum over pairs is a blur, and a blur can
# be computed without visiting pairs: along rows and columns, or on a lattice of triangles.
#
# **You will be able to**
# - rewrite a sum over all pairs as a filter, and say what it saves;
# - find the triangle of the permutohedral lattice around a point, and the point's weights, by hand;
# - derive how far apart its vertices must be, and how high the filter's peak is;
# - subtract what a cell tells itself;
# - find out whether an approximation or the model is to blame for a bad map.
#
# **Prerequisites.** Lecture [10](10_crf.ipynb): equations (3) and (4), mean field with damping, normalisation.
#
# **Time.** 75 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.5, equation (4) at full size. Its inference is that of Krähenbühl and Koltun (2011), with the
# lattice of Adams, Baek and Davis (2010).

# %% jupyter={"source_hidden": true}
from dataclasses import replace
from itertools import islice

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact
from scipy.spatial.distance import cdist
from scipy.special import softmax

from semgrid_edu import crf, fast, plotting
from semgrid_edu.crf import lattice
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from worlds import lecture_11_lattice, lecture_11_street

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
spec = GridSpec.compact()
street = lecture_11_street.unrefined(spec)
log_g, o, truth = street[-1]  # the network's answer, the occupancy grid, the true classes
params = crf.CrfParams.for_cells(spec.cell)
by_network, refined = log_g.argmax(axis=0), fast.mean_field(-log_g, o, params).argmax(axis=0)
CAR, ROAD = KITTI_14.index("car"), KITTI_14.index("road")

# %% [markdown]
# ## How can each cell hear all others?
#
# On the left is what a network says of a street. In the middle is the same map after the CRF of lecture 10. On the
# right is the occupancy grid, which tells the CRF where things end.

# %% jupyter={"source_hidden": true} alt="three maps of one street: the network's classes with ragged edges, the refined classes with smoother regions, and the occupancy grid; at A single wrong cells vanish, at B a car that the network found in part is gone after the CRF"
LETTERS = {"A": (-8.5, 42), "B": (5.2, 22.5)}


def note(ax, letters=LETTERS):
    """Write letters onto a map."""
    circle = {"boxstyle": "circle", "facecolor": "white", "edgecolor": "black"}
    for letter, place in letters.items():
        ax.text(*place, letter, ha="center", va="center", fontsize=9, bbox=circle)


fig, axes = plt.subplots(1, 3, figsize=(10, 4.2), layout="compressed")
for ax, title, labels in zip(axes, ("network", "after the CRF"), (by_network, refined), strict=False):
    plotting.grid_labels(spec, labels, KITTI_14, ax=ax, legend=False).set(title=title, ylim=(0, 50), xlim=(15, -12))
plotting.class_legend(axes[1], KITTI_14, np.stack([by_network, refined]))
plotting.occupancy(spec, o, ax=axes[2]).set(title="occupancy grid", ylim=(0, 50), xlim=(15, -12))
for ax in axes:
    note(ax)
plt.show()

# %% [markdown]
# At A, single cells of other classes vanish. At B the network had found a part of a car, left of the letter. After
# the CRF it is gone. Remember B: at the end we ask who is to blame.
#
# The map has 8804 cells. In lecture 10 every cell heard every other one, in each of ten iterations. That is 39 million
# pairs. What does hearing mean? Take three cells in a row and one class, car. The network gives it
# 0.9, 0.5 and 0.1. A neighbour counts 0.6, a cell two places away 0.1. Each cell adds up kernel times probability:
#
# ```
# cell 1 hears   0.6 · 0.5 + 0.1 · 0.1 = 0.31
# cell 2 hears   0.6 · 0.9 + 0.6 · 0.1 = 0.60
# cell 3 hears   0.1 · 0.9 + 0.6 · 0.5 = 0.39
# ```
#
# **Predict before you run.** Three cells need six products. The paper's grid has 355 x 155 cells. How many products
# does it need, for one class and one iteration? How large is the matrix of all kernel values, with 8 bytes for each?
#
# <details><summary>Answer</summary>
#
# 55,025 cells make the square of that, 3 billion, products. The matrix takes 24 GB, and there are two kernels.
#
# </details>
#
# Now look at the three lines again, and let each cell also count itself, with weight 1. Each cell then computes a
# weighted sum, with the largest weight at its own place. A photo editor does the same when it blurs an image. The
# probabilities of one class are such an image. In the field's words, **message passing is filtering**. With $Q_i(l)$
# the probability of class $l$ in cell $i$, $\phi_i(l)$ the network's price and $k_{ij}$ the kernel, an update of
# lecture 10 is
#
# $$ \log Q_i(l) \leftarrow -\phi_i(l) + \underbrace{\sum_{j} k_{ij}\, Q_j(l)}_{\text{blurred map}}
#    - \underbrace{k_{ii}\, Q_i(l)}_{\text{the cell itself}} + \text{const.} $$
#
# (Lecture 10 wrote $-\sum_j k_{ij}\,(1 - Q_j(l))$. The difference is the same for all classes, so it cancels.)


# %% tags=["filters"]
def mean_field_by_filters(unary, filters, own, iterations=10):
    """Run mean field, given functions that blur (N, C) values, and k_ii of all of them together, (N,)."""
    phi = unary.reshape(len(unary), -1).T  # one row per cell
    part = crf.damping(own)[:, None]  # lecture 10: so that the free energy never rises
    log_Q = -phi
    for _ in range(iterations):
        Q = softmax(log_Q, axis=1)
        hears = sum(blur(Q) for blur in filters) - own[:, None] * Q
        log_Q = log_Q + part * (hears - phi - log_Q)
    return softmax(log_Q, axis=1).T.reshape(unary.shape)


small = np.s_[:, 80:104, 16:32]
matrix = crf.gram_matrix(o[small], params)  # both kernels, each cell with itself included
ours = mean_field_by_filters(-log_g[small], [lambda Q: matrix @ Q], np.diag(matrix))
np.testing.assert_allclose(ours, crf.mean_field_naive(-log_g[small], o[small], params), atol=1e-6)

# %% [markdown]
# The last line says: if the blur is a product with the matrix, this is lecture 10's mean field. So each cell can hear
# all others if we have a fast blur. We need one for each kernel of equation (4).
#
# ## Can we blur the rows first, then the columns?
#
# The *spatial* kernel of equation (4) depends on the place alone. Take a map that is one in the middle and zero
# elsewhere, and a kernel that is one at distance zero and 0.6 at distance one. Blur each row by itself, then each
# column:
#
# ```
#  0   0   0          0    0    0          0.36  0.6  0.36
#  0   1   0   rows   0.6  1   0.6  cols   0.6   1    0.6
#  0   0   0   ───▶   0    0    0   ───▶   0.36  0.6  0.36
# ```
#
# The corner has got `0.6 · 0.6`. Is this what a Gaussian gives at distance $\sqrt 2$? It is, because the exponential
# turns a sum into a product. For cells that are $u$ rows and $v$ columns apart,
#
# $$ \exp\!\left(-\frac{u^2 + v^2}{2\sigma^2}\right)
#    = \exp\!\left(-\frac{u^2}{2\sigma^2}\right) \exp\!\left(-\frac{v^2}{2\sigma^2}\right). $$
#
# A kernel with this property is called **separable**.


# %% tags=["separable"]
def blur_rows_and_columns(values, sigma):
    """Return sum_j exp(-|r_i - r_j|^2 / 2 sigma^2) values_j for each cell of a map (H, W), in two passes."""
    rows, columns = (np.exp(-0.5 * np.subtract.outer(a, a) ** 2 / sigma**2) for a in map(np.arange, values.shape))
    return rows @ values @ columns


car = np.exp(log_g[CAR])[80:120, 11:51]
place = np.indices(car.shape).reshape(2, -1).T
all_pairs = np.exp(-0.5 * cdist(place, place, "sqeuclidean") / params.sigma_gamma**2) @ car.ravel()
two_passes = blur_rows_and_columns(car, params.sigma_gamma)
np.testing.assert_allclose(two_passes.ravel(), all_pairs, rtol=1e-5)
print(f"products for each cell: all pairs {car.size}, two passes {sum(car.shape)}")

# %% jupyter={"source_hidden": true} alt="the probability of car in 40 by 40 cells: as the network gives it, after the rows are blurred, and after rows and columns are blurred"
reach = np.arange(car.shape[1])
along_rows = car @ np.exp(-0.5 * np.subtract.outer(reach, reach) ** 2 / params.sigma_gamma**2)
fig, axes = plt.subplots(1, 3, figsize=(10, 3.2), layout="constrained")
pictures = {"network: P(car)": car, "rows blurred": along_rows, "rows and columns blurred": two_passes}
for ax, (title, picture) in zip(axes, pictures.items(), strict=True):
    ax.imshow(picture, cmap="gray", vmin=0)
    ax.set(title=f"{title} (white: {picture.max():.1f})", xlabel="column", ylabel="row")
plt.show()

# %% [markdown]
# The two passes give the sum over all pairs, but for rounding. The package's `SeparableGaussian` does the same. It
# also normalises as in lecture 10, because the kernel's row sums separate, too. So the spatial kernel is solved, and
# nothing is lost.
#
# ## How can a blur stop at a wall?
#
# The *bilateral* kernel also compares occupancy. Take two neighbouring cells, one certainly FREE, one certainly STATIC.
# The two lists of four probabilities are $\sqrt 2$ apart. With the width $\sigma_\beta = 0.2$ the kernel falls to
# $e^{-25}$: the two don't hear each other. So this blur must stop at the edge of a wall. It has another shape around
# each cell. Two passes with the same weights everywhere can't do that.
#
# Here is the trick. Give each cell more coordinates: its row, its column and its four probabilities, each divided by
# its width. We call them the **features** $f$ of the cell. In this space the kernel is $\exp(-|f_i - f_j|^2 / 2)$. It
# depends on the distance and on nothing else. The wall is still there: it has become a gap that no cell is in. (The
# four probabilities sum to 1, so three numbers are enough. A change of basis keeps all distances, and `d = 5`
# features remain.)

# %%
features = lattice.bilateral_features(o, params)  # (N, 5)
some = slice(3000, 3200)
probabilities = o.reshape(4, -1).T[some] / params.sigma_beta
np.testing.assert_allclose(
    cdist(features[some, 2:], features[some, 2:]), cdist(probabilities, probabilities), atol=1e-4
)

# %% [markdown]
# In five dimensions we can't visit every place. Most of the space is empty. So we lay out a coarse grid of vertices,
# let each cell give its value to the vertices around it, blur between vertices, and read the result back. How many
# vertices surround a cell? A square has four corners, a cube eight, and a cube in five dimensions 32. A triangle has
# three corners, a tetrahedron four: these shapes are **simplices**. In five dimensions a simplex has only 6. So a
# blur stops at a wall when it runs on simplices in the space of features.
#
# ## Which triangle is a point in?
#
# We begin with two features, so simplices are triangles. The **permutohedral lattice** fills the plane with
# equal triangles, in such a way that the triangle around a point is found by rounding and sorting. For this, a
# point is written as three numbers that sum to zero:
#
# $$ y = \left(\sqrt 3\, f_1 + f_2,\;\; -\sqrt 3\, f_1 + f_2,\;\; -2 f_2\right) $$
#
# (Why these factors? The section after the next one derives them.) A vertex of the lattice is a $y$ of three
# **integers that have the same remainder modulo 3**. So `(3, 0, -3)` is a vertex, with remainder zero. So is `(4, 1,
# -5)`, with remainder one. But `(2, 0, -2)` isn't one. A step to a neighbour adds one to two of the numbers and takes
# two from the third, or does the opposite.
#
# Let us find the triangle around `y = (4.2, -0.4, -3.8)`:
#
# ```
# 1. Round each number to a multiple of 3:       (3, 0, -3)      sums to zero, so it is a vertex
# 2. Residuals, what rounding left over:         (1.2, -0.4, -0.8)
# 3. Step: the smallest residual loses 2:        (4, 1, -5)
# 4. Step: the second smallest loses 2:          (5, -1, -4)
# 5. Weights, gaps between sorted residuals / 3:
#       third corner   (1.2 + 0.4) / 3  = 0.53
#       second corner  (-0.4 + 0.8) / 3 = 0.13
#       first corner   the rest         = 0.33
# ```
#
# The gap below the largest residual belongs to the last corner, and so on backwards. These are
# **barycentric weights**. They sum to 1, and the weighted mean of the corners is the point. Check
# the first number: `0.33 · 3 + 0.13 · 4 + 0.53 · 5 = 4.2`.
#
# **Predict before you run.** Now `y = (1.7, 1.6, -3.3)`. Rounding gives `(3, 3, -3)`. The sum isn't zero, so this is no
# vertex. Which number do you round the other way?
#
# <details><summary>Answer</summary>
#
# The second. Its residual, -1.4, is the smallest: it was rounded up the farthest. So the first corner is `(3, 0, -3)`
# again, and the residuals are `(-1.3, 1.6, -0.3)`.
#
# </details>

# %% tags=["simplex"] jupyter={"outputs_hidden": true}
points = np.array([[4.2, -0.4, -3.8], [1.7, 1.6, -3.3]])
for corners, weights in zip(*crf.enclosing_simplices(points), strict=True):
    print("corners", *map(tuple, corners.tolist()), " weights", weights.round(2))
np.testing.assert_allclose(lattice.elevated([[1.0, 2.0]]), [[np.sqrt(3) + 2, -np.sqrt(3) + 2, -4]])

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="a plane of triangles; two points in orange, the three corners of their triangles marked with coordinates, and a weight at each link; the nearer a corner, the larger its weight"
fig, ax = plt.subplots(figsize=(6.6, 4.4), layout="constrained")
lecture_11_lattice.draw_triangles((-1.0, 0.4), (2.9, 3.0), ax)
for place in lecture_11_lattice.vertex_places(points):
    lecture_11_lattice.draw_simplex(place, ax)
ax.set(xlabel="first feature [widths]", ylabel="second feature [widths]")
plt.show()

# %% [markdown]
# The two triangles share the corner `(3, 0, -3)`. With $d$ features the recipe is the same: $d + 1$ numbers that sum
# to zero, multiples of $d + 1$, a sort, $d + 1$ corners. Here is the book's code. It does all points at once:

# %% jupyter={"source_hidden": true}
lecture_11_lattice.code_of(crf.enclosing_simplices)

# %% [markdown]
# Move a point and watch its weights (with a running kernel). When does a weight become zero? What happens to the others
# there?


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
def show(first, second):
    """Draw the triangle around a point."""
    _, ax = plt.subplots(figsize=(5, 4), layout="constrained")
    lecture_11_lattice.draw_triangles((-1.3, -1.2), (2.3, 2.2), ax)
    lecture_11_lattice.draw_simplex(np.array([first, second]), ax)
    ax.set(xlabel="first feature [widths]", ylabel="second feature [widths]")
    plt.show()


_ = interact(
    show,
    first=FloatSlider(value=0.3, min=-0.5, max=1.5, step=0.2),
    second=FloatSlider(value=0.5, min=-0.5, max=1.5, step=0.2),
)

# %% [markdown]
# A weight becomes zero on the opposite side of the triangle, where the point leaves it. So nothing jumps when a point
# goes from one triangle to the next. The triangle costs a rounding and a sort, and no cell needs another cell for it.
#
# ## How do cells talk through the vertices?
#
# The filter has three steps:
#
# - **Splat.** Each cell gives its value to its corners, by its weights.
# - **Blur.** Along each of the three directions in turn, a vertex keeps half of its value and gets a quarter of each
#   neighbour's.
# - **Slice.** Each cell takes the weighted mean of its corners, with the same weights.
#
# Write the weights as a matrix $S$, with one row per cell and one column per vertex. Splat is a product with
# $S^\top$, slice is a product with $S$, and each blur is a matrix with ½ on its diagonal and ¼ where two
# vertices are neighbours. All of them are nearly empty. Here is the rest of the book's code; with what you
# saw above these are some thirty lines:

# %% jupyter={"source_hidden": true} tags=["splat-blur-slice"]
Lattice = crf.PermutohedralLattice
lecture_11_lattice.code_of(Lattice.build.__func__, lattice._blur, Lattice.__call__)

# %% [markdown]
# Only vertices around cells are numbered, so empty space costs nothing. (What a blur would move to a vertex that
# isn't there is lost. The exercise mends that.) Watch the filter work on a row of 36 cells. The left half is FREE,
# the right half STATIC. The network gives *road* about 0.75 on the left and 0.25 on the right, with much noise. Each
# cell is a point: to the right its place in the row, upwards its P(FREE).


# %%
def row(seed):
    """Return features (36, 2) and P(road) of a row of cells: free road on the left, a wall on the right."""
    rng = np.random.default_rng(seed)
    left = np.arange(36) < 18
    p_free = np.clip(np.where(left, 0.92, 0.08) + rng.normal(0, 0.05, 36), 0, 1)
    p_road = np.clip(np.where(left, 0.75, 0.25) + rng.normal(0, 0.22, 36), 0, 1)
    return np.column_stack([np.arange(36) / 4, p_free / 0.2]), p_road  # widths of 4 cells, and of 0.2


def smoothed(points, values):
    """Return the weighted mean around each point: filtered values over filtered ones."""
    sums, ones = Lattice.build(points)(np.column_stack([values, np.ones(len(values))])).T
    return sums / ones


# %% jupyter={"source_hidden": true} alt="animation: 36 points in two groups give their colours to corners of triangles, the corners blur along three directions, and the points take smoothed colours back; the two groups never mix"
def pictures(points, values):
    """Yield the frames of the animation on one figure."""
    fig, ax = plt.subplots(figsize=(6, 4.1))
    fig.subplots_adjust(left=0.09, right=0.98, bottom=0.11, top=0.93)
    lecture_11_lattice.draw_triangles((-1.4, -1.4), (10.2, 6.4), ax)
    ax.set(xlabel="place in the row / 4 cells", ylabel="P(FREE) / 0.2")
    story = list(lecture_11_lattice.lattice_story(points, values, between=1))
    for frame, following in zip(story, [*story[1:], story[0]], strict=True):
        for marks in ax.collections[1:]:
            marks.remove()
        lecture_11_lattice.draw_lattice_frame(frame, ax)
        for _ in range(4 if following.title != frame.title else 1):
            yield fig


plotting.animate(pictures(*row(5)), period=0.25, alt="36 points splat onto triangles, blur, and slice back")

# %% [markdown]
# Dark is a low P(road), bright a high one, and the area shows how much a mark holds. Within each group the colours even
# out. No vertex joins the two groups, so nothing crosses the wall. Is it really the second feature that stops the
# blur? Switch it off, and blur by the place alone:

# %% jupyter={"source_hidden": true} alt="P(road) of 36 cells in a row: noisy dots near 0.75 on the left and 0.25 on the right; blurred by place alone, the curve slides from high to low across the wall; blurred by place and occupancy, it jumps at the wall"
points, p_road = row(5)
fig, ax = plt.subplots(figsize=(6.4, 3), layout="constrained")
ax.plot(p_road, "o", color="0.6", label="network")
ax.plot(smoothed(points[:, :1], p_road), "--", color="#d55e00", label="blurred by place")
ax.plot(smoothed(points, p_road), "-", color="#0072b2", label="blurred by place and occupancy")
ax.axvline(17.5, color="0.3", linewidth=1, linestyle=":")
ax.set(xlabel="cell", ylabel="P(road)", ylim=(0, 1))
ax.legend(fontsize=9, frameon=False)
plt.show()

# %%
near_wall, right = slice(14, 22), np.repeat([0.75, 0.25], 18)
errors = {"network": [], "by place": [], "by place and occupancy": []}
for seed in range(20):
    points, p_road = row(seed)
    ways = p_road, smoothed(points[:, :1], p_road), smoothed(points, p_road)
    for found, way in zip(errors.values(), ways, strict=True):
        found.append(np.abs(way - right)[near_wall].mean())
print("mean error near the wall, 20 rows:", {way: float(np.mean(found).round(2)) for way, found in errors.items()})
assert np.mean(errors["by place and occupancy"]) < 0.6 * np.mean(errors["by place"])

# %% [markdown]
# Without the second feature the blur smears road into the wall. So cells talk through vertices they share, and a gap in
# the features keeps them apart.
#
# ## How far apart must the vertices be?
#
# Large triangles blur widely, small ones hardly. We want the Gaussian's variance, 1 along each axis. Call the side of
# a triangle $a$ and follow a value through the three steps.
#
# ```
# one blur     moves a quarter by a forward, a quarter by a back;  along its direction  a²/4 + a²/4  =  a²/2
# three blurs  60° apart, squared cosines sum to 3/2;              along any axis       3/2 · a²/2   =  3a²/4
# splat        moves a point to its corners                        (see below)                          a²/8
# slice        the same backwards                                                                       a²/8
# ```
#
# Splat needs a thought. Seen from the middle of the triangle, the squared distance of a corner is $a^2/3$. That of a
# point is $a^2/12$, on average over the triangle. The weighted mean of the corners is the point itself, so what splat
# adds is the difference: `a²/4`, half of it along each axis. All four together must be 1:
#
# $$ \frac{3a^2}{4} + \frac{a^2}{8} + \frac{a^2}{8} = a^2 = 1 $$
#
# So **the sides are exactly one width long**. As three numbers a step such as `(1, 1, -2)` has the length $\sqrt 6$.
# Hence the factors of $y$ above: they stretch the plane by $\sqrt 6$.
#
# And how high is the kernel? Splat and blur keep the sum. Slice reads a vertex fully at its place and less and less
# towards its six neighbours: that is a pyramid of height one on six triangles. A pyramid has a third of base times
# height, so a value of 1 adds up to the area of two triangles, `√3/2`, over the plane. A Gaussian of height one has the
# integral `2π`. So the filter must be multiplied by
#
# ```
# 2π / (√3 / 2) = 4π / √3 = 7.26
# ```
#
# The book's `elevation(d)` and `peak(d)` are the same for $d$ features. Are both right? Put a 1 at places all over a
# dense cloud, and measure what comes out:

# %% tags=["spacing"]
cloud = np.stack(np.meshgrid(*[np.arange(-5, 5, 0.1)] * 2), axis=-1).reshape(-1, 2)
plane = Lattice.build(cloud)
inner = np.flatnonzero(np.abs(cloud).max(axis=1) < 1.2)[::3]
ones = np.zeros((len(cloud), len(inner)))
ones[inner, np.arange(len(inner))] = 1
kernel = plane(ones)  # one column for each place
away = cloud[:, None] - cloud[inner]
variance = (kernel[..., None] * away**2).sum(axis=(0, 1)) / kernel.sum()
integral = kernel.sum() / len(inner) * 0.1**2
print(f"variance along the axes {variance.round(2)}, integral {integral:.2f}, 2 pi = {2 * np.pi:.2f}")
np.testing.assert_allclose([*variance, integral], [1, 1, 2 * np.pi], rtol=0.01)
np.testing.assert_allclose(lattice.peak(2), 4 * np.pi / np.sqrt(3))

# %% [markdown]
# Variance and integral are the Gaussian's. The shape needn't be.
#
# ## What does a cell tell itself?
#
# The filter adds up all cells, the listening one included. A cell is no pair with itself, so $k_{ii}\, Q_i$ must be
# subtracted. For a Gaussian $k_{ii}$ is 1. For the lattice we can find it by hand. Put a 1 on one vertex and blur three
# times. In the middle (½)³ stays. A part comes back: one step forward in each of the three directions leads to
# where it began, and so does one step back in each. A neighbour is reached by one step, or by two steps back along the
# other directions:
#
# ```
# middle     1/2 · 1/2 · 1/2 + 1/4 · 1/4 · 1/4 + 1/4 · 1/4 · 1/4  =  10/64
# neighbour  1/4 · 1/2 · 1/2 + 1/2 · 1/4 · 1/4                    =   6/64
# ```
#
# **Predict before you run.** A cell on a vertex gives it everything and reads it back: `10/64 · 7.26 = 1.13`. What does
# a cell get back that is in the middle of a triangle, with weight ⅓ on each corner?
#
# <details><summary>Answer</summary>
#
# Each corner gets ⅓. After the blur it holds `⅓ · (10 + 6 + 6)/64`: its own part and those of the two others. The
# cell reads the mean of three equal numbers: `22/192 · 7.26 = 0.83`.
#
# </details>

# %% tags=["own"] jupyter={"outputs_hidden": true}
special = {"on a vertex": np.array([0.0, 0.0]), "in the middle": np.array([1 / np.sqrt(3), 0.0])}
plane = Lattice.build(np.concatenate([cloud, list(special.values())]))
print(dict(zip(special, plane.diagonal[-2:].round(2).tolist(), strict=True)))
np.testing.assert_allclose(plane.diagonal[-2:], np.array([10 / 64, 22 / 192]) * lattice.peak(2))

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left and middle: the kernel around a point on a vertex, slightly hexagonal, and around a point in the middle of a triangle, slightly triangular and lower; right: kernel values against distance scatter around the Gaussian"
fig, axes = plt.subplots(1, 3, figsize=(10, 3.4), layout="constrained", width_ratios=(1, 1, 1.2))
distance = np.linspace(0, 4, 100)
for ax, colour, (index, (name, at)) in zip(axes, ("#0072b2", "#d55e00"), enumerate(special.items()), strict=False):
    one = np.zeros((len(cloud) + 2, 1))
    one[len(cloud) + index] = 1
    heard = plane(one)[: len(cloud), 0]
    image = heard.reshape(100, 100)
    ax.imshow(image, origin="lower", extent=(-5, 5, -5, 5), cmap="gray", vmin=0, vmax=1.15)
    lecture_11_lattice.draw_triangles(at - 2.6, at + 2.6, ax).collections[0].set(alpha=0.5)
    ax.contour(image, [0.1, 0.5], colors=colour, extent=(-5, 5, -5, 5))
    ax.set(title=f"a cell {name}", xlabel="first feature [widths]", ylabel="second feature [widths]")
    style = {"marker": "o.^"[2 * index], "linestyle": "", "markersize": 3, "alpha": 0.4}
    axes[2].plot(np.linalg.norm(cloud - at, axis=1)[::7], heard[::7], color=colour, label=name, **style)
axes[2].plot(distance, np.exp(-0.5 * distance**2), "k", label="Gaussian")
axes[2].set(xlim=(0, 4), xlabel="distance [widths]", ylabel="kernel")
axes[2].legend(fontsize=9, frameon=False)
plt.show()

# %% [markdown]
# The kernel follows the Gaussian, but it is a little hexagonal or triangular, and it depends on where a cell is in
# its triangle. So we must subtract what *this* filter gives back at *this* cell, its **self-response**: the diagonal
# of $S M S^\top$, with $M$ for all blurs together, times the peak. Does it matter? Run the CRF of the street with the
# right diagonal, and with nothing subtracted:

# %% tags=["nbval-ignore-output"]
bilateral = crf.bilateral_kernel(o, params)
spatial = crf.SeparableGaussian.build(spec.shape, params.sigma_gamma, params.w_spatial, params.normalization)
own = bilateral.diagonal + spatial.diagonal
Q = mean_field_by_filters(-log_g, [bilateral, spatial], own)
np.testing.assert_allclose(Q, fast.mean_field(-log_g, o, params), atol=2e-3)
off = np.abs(mean_field_by_filters(-log_g, [bilateral, spatial], 0 * own) - Q).max(axis=0)
print(f"nothing subtracted: a probability changes by more than 0.1 in {(off > 0.1).sum()} of {off.size} cells")
share = bilateral.diagonal / params.w_bilateral  # of what a cell hears from all cells, how much is its own
print(f"a cell's own share of what it hears: {np.median(share):.2f} in the typical cell,", end=" ")
print(f"{np.median(share[off.ravel() > 0.1]):.2f} in these")
assert off.max() > 0.3
assert (off > 0.1).mean() < 0.1
assert np.median(share[off.ravel() > 0.1]) > 3 * np.median(share)

# %% [markdown]
# In most cells it doesn't matter, because many others drown what a cell tells itself. It matters in lonely cells, whose
# occupancy is unlike that of their neighbours. A large share of what they hear is their own. They would confirm their
# own opinion.
#
# ## Where this breaks: is the lattice to blame?
#
# Our kernel isn't quite Gaussian. At B a car has vanished. Is that why? Three errors are easily mixed up:
#
# - the **kernel error**: another kernel, the same number of iterations;
# - the **convergence error**: the same kernel, stopped before it settles;
# - the error of mean field itself (lecture 10), which no filter removes.
#
# On 60 x 40 cells around B all pairs can still be written down, so the first two can be measured. We compare
# probabilities, as mean difference. A trivial way to run the CRF is not to run it: that is the first line.

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
near_B = np.s_[:, 78:138, 6:46]
unary, values = -log_g[near_B], o[near_B]
exact = list(islice(crf.mean_field_updates(unary, values, params), 31))  # all pairs, 0 to 30 iterations
for way, found, wanted in (
    ("no CRF at all, against all pairs", exact[0], exact[10]),
    ("kernel error: the book's lattice, 10 iterations", crf.mean_field(unary, values, params), exact[10]),
    ("kernel error: fast.mean_field, 10 iterations", fast.mean_field(unary, values, params), exact[10]),
    ("convergence error: all pairs, 10 iterations", exact[10], exact[30]),
):
    error, same = np.abs(found - wanted).mean(), (found.argmax(axis=0) == wanted.argmax(axis=0)).mean()
    print(f"{way:<50} {error:.4f}, same label in {100 * same:.0f} % of cells")
    assert way.startswith("no CRF") or (error < 0.002 and same > 0.97)
products = (2 * bilateral.shares.nnz + sum(blur.nnz for blur in bilateral.blurs)) / o[0].size
print(f"products for a cell and a class: all pairs {o[0].size}, lattice {products:.0f}")

# %% [markdown]
# Both errors are small beside what the CRF changes. And the lattice needs some twenty products where all pairs need
# 8804. In time, on the paper's grid with ten iterations and 14 classes
# ([measured](../benchmarks/README.md) on two cores):
#
# | way | kernel | time |
# |---|---|---|
# | all pairs | exact | the matrices don't fit |
# | `pydensecrf2`, which wraps Krähenbühl's code, one thread | lattice | 0.12 to 0.16 s |
# | `fast.mean_field`, two threads | lattice | 0.07 to 0.10 s |
#
# The LIDAR scans ten times a second, so the CRF alone takes most of the time there is.
#
# **Predict before you run.** The lattice could still be wrong exactly at the cars. Switch it off: run all pairs.
# Does the CRF with all pairs keep more cells of the cars? And with all pairs and three times as many iterations?
#
# <details><summary>Answer</summary>
#
# No. Both lose as many cells of cars as the lattice does, but for two or three.
#
# </details>

# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true}
is_car = truth[near_B[1:]] == CAR
ways = {
    "network": exact[0],
    "CRF, lattice": fast.mean_field(unary, values, params),
    "CRF, all pairs": exact[10],
    "CRF, all pairs, 30 iterations": exact[30],
}
found = {way: (is_car & (probabilities.argmax(axis=0) == CAR)).sum() for way, probabilities in ways.items()}
for way, cells in found.items():
    print(f"{way:<30} finds {cells:3d} of {is_car.sum()} car cells")
assert abs(found["CRF, lattice"] - found["CRF, all pairs"]) <= 4
assert found["CRF, all pairs"] < 0.8 * found["network"]

# %% [markdown]
# Neither the lattice nor the early stop is to blame. What is left is mean field itself, or the model. Look at the
# model's widths. The spatial kernel has a width of 1.2 cells, the bilateral one 3.2. A car is four cells wide. So a
# cell at its edge hears more strangers than cells of the car, as far as their occupancy is alike. If this explanation
# is right, the cars come back when the bilateral kernel reaches no farther than the spatial one:

# %% tags=["nbval-ignore-output"]
short = replace(params, sigma_alpha=params.sigma_gamma)
again = (is_car & (fast.mean_field(unary, values, short).argmax(axis=0) == CAR)).sum()
print(f"the network finds {found['network']} car cells, the CRF {found['CRF, lattice']}, with a short reach {again}")
assert again > 0.9 * found["network"]

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="four maps of the street around B: the truth with seven cars, the network's map with most of them in part, the CRF's, in which the car at B is gone, and the CRF's with a short reach, in which it is there again"
maps = {"truth": truth, "network": by_network, "CRF": refined,
        "CRF, short reach": fast.mean_field(-log_g, o, short).argmax(axis=0)}  # fmt: skip
fig, axes = plt.subplots(1, 4, figsize=(10, 3.9), layout="compressed", sharey=True)
for ax, (title, labels) in zip(axes, maps.items(), strict=True):
    plotting.grid_labels(spec, labels, KITTI_14, ax=ax, legend=False).set(title=title, ylim=(2, 36), xlim=(14, -6))
    ax.set_ylabel("x, forward [m]" if ax is axes[0] else "")
    note(ax, {"B": LETTERS["B"]})
plotting.class_legend(axes[-1], KITTI_14, np.stack(list(maps.values())))
plt.show()

# %% [markdown]
# They do. Is a short reach the better choice, then? Ask five frames of the drive:

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
scores = {}
for way, chosen in (("network", None), ("CRF", params), ("CRF, short reach", short)):
    answers = [(s.log_g if chosen is None else fast.mean_field(-s.log_g, s.o, chosen)).argmax(axis=0) for s in street]
    right = np.concatenate([(answer == s.truth).ravel() for answer, s in zip(answers, street, strict=True)])
    classes = np.concatenate([s.truth.ravel() for s in street])
    scores[way] = cars, roads, all_cells = right[classes == CAR].mean(), right[classes == ROAD].mean(), right.mean()
    print(
        f"{way:<17} right: {100 * cars:.0f} % of cars, {100 * roads:.0f} % of road, {100 * all_cells:.1f} % of all cells"
    )
assert scores["CRF"][0] < scores["CRF, short reach"][0] < scores["network"][0]
assert all(scores["CRF"][k] > scores["CRF, short reach"][k] > scores["network"][k] for k in (1, 2))

# %% [markdown]
# It is a trade. A long reach gets more road and more cells right, and pays with cars. No better filter changes that,
# because the model asks for it. The companion [the CRF, measured](deeper/11_crf_measured.ipynb) shows the trade
# on many more streets.
#
# ## In five lines
#
# 1. Mean field needs a sum over all pairs; that sum is a blur, so a filter can compute it.
# 2. The spatial kernel is separable: rows, then columns, nothing lost.
# 3. The bilateral kernel is a Gaussian of features. Splat, blur, slice: each cell talks to the corners of its simplex,
#    which rounding and sorting find. In the plane their sides are one width long.
# 4. The filter counts the cell itself; subtract what this filter gives back at this cell, not 1.
# 5. The lattice's kernel is only nearly Gaussian, and that hardly shows. Cars vanish because the model wants it: all
#    pairs lose them, too, and a shorter reach keeps them.
#
# ## Further reading and exercise
#
# - Krähenbühl, Koltun, *Efficient inference in fully connected CRFs with Gaussian edge potentials*, NIPS 2011.
# - Adams, Baek, Davis, *Fast high-dimensional filtering using the permutohedral lattice*, Eurographics 2010.
# - Paris, Durand, *A fast approximation of the bilateral filter using a signal processing approach*, ECCV 2006: cubes,
#   before simplices.
#
# [Exercise 11](exercises/11_fast_crf.ipynb): a blur over gaps, a blur that loses nothing, the self-response of
# many cells at once; and a CRF of your own that refines the drive. Next: lecture [12](12_experiments.ipynb), what the
# paper's experiments can tell.
