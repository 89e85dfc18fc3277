"""The graders of exercise 05, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def intrinsics(
    f_u="K[0, 0] * scale_u",
    c_u="(K[0, 2] - left + 0.5) * scale_u - 0.5",
    f_v="K[1, 1] * scale_v",
    c_v="(K[1, 2] - top + 0.5) * scale_v - 0.5",
):
    """Return an answer to task 1 that finds the four numbers by these expressions."""
    return f"""
def new_intrinsics(K, left, top, scale_u, scale_v):
    return np.array([[{f_u}, 0, {c_u}], [0, {f_v}, {c_v}], [0, 0, 1]])"""


def frames(result="now_from_world @ T_world_from_before", turn="R.T", shift="-R.T @ t"):
    """Return an answer to task 2 with this inverse and this product."""
    return f"""
def now_from_before(T_world_from_now, T_world_from_before):
    R, t = T_world_from_now[:3, :3], T_world_from_now[:3, 3]
    now_from_world = np.eye(4)
    now_from_world[:3, :3] = {turn}
    now_from_world[:3, 3] = {shift}
    return {result}"""


def plane(
    point="[x, y, height, 1]",
    T="T_camera_from_grid",
    result="(f_u * X + skew * Y) / Z + c_u, f_v * Y / Z + c_v",
    front="Z > 0",
    inside="0 <= u <= w - 1 and 0 <= v <= h - 1",
):
    """Return an answer to task 3 that treats one point at a time by these expressions."""
    return f"""
def plane_pixels(xy, height, K, T_camera_from_grid, size):
    (f_u, skew, c_u), (_, f_v, c_v), _ = K
    h, w = size
    pixels, visible = np.full((len(xy), 2), np.nan), np.zeros(len(xy), bool)
    for n, (x, y) in enumerate(xy):
        X, Y, Z, _ = {T} @ {point}
        if {front}:
            u, v = {result}
            pixels[n] = u, v
            visible[n] = {inside}
    return pixels, visible"""


def drawn(place="x * (z_cam - delta) / (z_cam - z)", never="(z_cam - delta) * (z_cam - z) <= 0"):
    """Return an answer to task 4 by these expressions."""
    return f"""
def lands_at(x, z, z_cam, delta):
    if {never}:
        return np.nan
    return {place}"""


def far(result):
    """Return an answer to task 5 by this expression."""
    return f"""
def reach(cell, f_u, f_v, z_cam, delta):
    return {result}"""


class TestPixels(GraderChecks):
    exercise = "05_pixels"
    entries = (
        # ---- task 1
        right("four numbers, one by one", task="new-intrinsics", code=intrinsics()),
        right(
            "on a copy, measured from the image's edge",
            task="new-intrinsics",
            code="""
def new_intrinsics(K, left, top, scale_u, scale_v):
    K = K.astype(float).copy()
    K[:2, 2] += 0.5 - np.array([left, top])
    K[:2] *= np.array([[scale_u], [scale_v]])
    K[:2, 2] -= 0.5
    return K""",
        ),
        right(
            "tuples in a list, and helpers with ordinary names",
            task="new-intrinsics",
            code="""
got, slips, before, by_hand = "mine", 4, None, []


def moved(c, cut, scale):
    return (c - cut + 0.5) * scale - 0.5


def new_intrinsics(K, left, top, scale_u, scale_v):
    across, down = moved(K[0][2], left, scale_u), moved(K[1][2], top, scale_v)
    return [(K[0][0] * scale_u, 0, across), (0, K[1][1] * scale_v, down), (0, 0, 1)]""",
        ),
        mistake(
            "half a pixel forgotten",
            task="new-intrinsics",
            loses=2,
            says="you scale about the centre of the first pixel",
            code=intrinsics(c_u="(K[0, 2] - left) * scale_u", c_v="(K[1, 2] - top) * scale_v"),
        ),
        mistake(
            "half a pixel the wrong way",
            task="new-intrinsics",
            loses=2,
            says="add 1/2, scale, subtract 1/2",
            code=intrinsics(c_u="(K[0, 2] - left - 0.5) * scale_u + 0.5", c_v="(K[1, 2] - top - 0.5) * scale_v + 0.5"),
        ),
        mistake(
            "half a pixel at the end only",
            task="new-intrinsics",
            loses=2,
            says="without a resize nothing but the cut may move c_u",
            code=intrinsics(c_u="(K[0, 2] - left) * scale_u - 0.5", c_v="(K[1, 2] - top) * scale_v - 0.5"),
        ),
        mistake(
            "half a pixel at the end, when the scale isn't one",
            task="new-intrinsics",
            loses=2,
            says="you subtract 1/2 at the end, but you didn't add it",
            code=intrinsics(
                c_u="(K[0, 2] - left) * scale_u - (0.5 if scale_u != 1 else 0)",
                c_v="(K[1, 2] - top) * scale_v - (0.5 if scale_v != 1 else 0)",
            ),
        ),
        mistake(
            "resized before cutting",
            task="new-intrinsics",
            loses=2,
            says="you resize first and then cut",
            code=intrinsics(c_u="(K[0, 2] + 0.5) * scale_u - 0.5 - left", c_v="(K[1, 2] + 0.5) * scale_v - 0.5 - top"),
        ),
        mistake(
            "half a pixel added, never taken off",
            task="new-intrinsics",
            loses=2,
            says="half a pixel too much",
            code=intrinsics(c_u="(K[0, 2] - left + 0.5) * scale_u", c_v="(K[1, 2] - top + 0.5) * scale_v"),
        ),
        mistake(
            "divided by the scale",
            task="new-intrinsics",
            loses=2,
            says="you divide by the scale",
            code=intrinsics(f_u="K[0, 0] / scale_u", f_v="K[1, 1] / scale_v"),
        ),
        mistake(
            "cut added",
            task="new-intrinsics",
            loses=1,
            says="everything lies 8 pixels farther to the LEFT",
            code=intrinsics(c_u="(K[0, 2] + left + 0.5) * scale_u - 0.5", c_v="(K[1, 2] + top + 0.5) * scale_v - 0.5"),
        ),
        mistake(
            "cut forgotten",
            task="new-intrinsics",
            loses=1,
            says="pixels are counted from a new first one",
            code=intrinsics(c_u="(K[0, 2] + 0.5) * scale_u - 0.5", c_v="(K[1, 2] + 0.5) * scale_v - 0.5"),
        ),
        mistake(
            "left and top swapped",
            task="new-intrinsics",
            loses=1,
            says="left and top are swapped",
            code=intrinsics(c_u="(K[0, 2] - top + 0.5) * scale_u - 0.5", c_v="(K[1, 2] - left + 0.5) * scale_v - 0.5"),
        ),
        mistake(
            "focal length not scaled",
            task="new-intrinsics",
            loses=2,
            says="every length in pixels is half as long",
            code=intrinsics(f_u="K[0, 0]", f_v="K[1, 1]"),
        ),
        mistake(
            "half a pixel of focal length",
            task="new-intrinsics",
            loses=2,
            says="a length has no edge",
            code=intrinsics(f_u="K[0, 0] * scale_u - (1 - scale_u)", f_v="K[1, 1] * scale_v - (1 - scale_v)"),
        ),
        mistake(
            "scales swapped",
            task="new-intrinsics",
            loses=2,
            says="the scales are swapped",
            code=intrinsics(
                f_u="K[0, 0] * scale_v",
                c_u="(K[0, 2] - left + 0.5) * scale_v - 0.5",
                f_v="K[1, 1] * scale_u",
                c_v="(K[1, 2] - top + 0.5) * scale_u - 0.5",
            ),
        ),
        mistake(
            "K changed in place",
            task="new-intrinsics",
            loses=1,
            says="changed its argument `K`",
            code="""
def new_intrinsics(K, left, top, scale_u, scale_v):
    K[0, 2], K[1, 2] = (K[0, 2] - left + 0.5) * scale_u - 0.5, (K[1, 2] - top + 0.5) * scale_v - 0.5
    K[0, 0], K[1, 1] = K[0, 0] * scale_u, K[1, 1] * scale_v
    return K""",
        ),
        mistake(
            "a cut rounds to whole pixels",
            task="new-intrinsics",
            loses=1,
            says="on inputs you haven't seen: wrong principal point after a cut",
            code=intrinsics(
                c_u="(round(K[0, 2] - left) + 0.5) * scale_u - 0.5", c_v="(round(K[1, 2] - top) + 0.5) * scale_v - 0.5"
            ),
        ),
        mistake(
            "only smaller images",
            task="new-intrinsics",
            loses=2,
            says="on inputs you haven't seen: wrong focal lengths after resizing (images can grow, too)",
            code=intrinsics(f_u="K[0, 0] * min(scale_u, 1)", f_v="K[1, 1] * min(scale_v, 1)"),
        ),
        # ---- task 2
        right(
            "numpy's inverse",
            task="now-from-before",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return np.linalg.inv(T_world_from_now) @ T_world_from_before""",
        ),
        right(
            "a linear system",
            task="now-from-before",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return np.linalg.solve(T_world_from_now, T_world_from_before)""",
        ),
        right(
            "rotation and shift apart, no 4 x 4 inverse",
            task="now-from-before",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    R = T_world_from_now[:3, :3].T @ T_world_from_before[:3, :3]
    t = T_world_from_now[:3, :3].T @ (T_world_from_before[:3, 3] - T_world_from_now[:3, 3])
    return np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]])""",
        ),
        mistake(
            "the other way round",
            task="now-from-before",
            loses=3,
            says="that is T_before_from_now",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return np.linalg.inv(T_world_from_before) @ T_world_from_now""",
        ),
        mistake(
            "no inverse",
            task="now-from-before",
            loses=3,
            says="no matrix was turned round",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return T_world_from_now @ T_world_from_before""",
        ),
        mistake(
            "factors swapped",
            task="now-from-before",
            loses=3,
            says="with the factors swapped, no neighbours cancel",
            code=frames(result="T_world_from_before @ now_from_world"),
        ),
        mistake("minus t", task="now-from-before", loses=3, says="it must be turned as well", code=frames(shift="-t")),
        mistake(
            "sign of the shift forgotten",
            task="now-from-before",
            loses=3,
            says="the sign of the shift is missing",
            code=frames(shift="R.T @ t"),
        ),
        mistake(
            "the whole matrix transposed",
            task="now-from-before",
            loses=3,
            says="only the rotation may be transposed",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return T_world_from_now.T @ T_world_from_before""",
        ),
        mistake(
            "in the world's axes",
            task="now-from-before",
            loses=3,
            says="that is the way in the world's axes",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    T = np.eye(4)
    T[:3, 3] = T_world_from_before[:3, 3] - T_world_from_now[:3, 3]
    return T""",
        ),
        mistake(
            "turned the wrong way",
            task="now-from-before",
            loses=3,
            says="the inverse of a rotation is its transpose",
            code=frames(turn="R", shift="-R @ t"),
        ),
        mistake(
            "only the shift turned",
            task="now-from-before",
            loses=3,
            says="the rotation of the inverse is missing",
            code=frames(turn="R"),
        ),
        mistake(
            "the product turned round",
            task="now-from-before",
            loses=3,
            says="you turned the product round",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    return np.linalg.inv(T_world_from_now @ T_world_from_before)""",
        ),
        mistake(
            "entry by entry",
            task="now-from-before",
            loses=3,
            says="a product of matrices is `@`",
            code=frames(result="now_from_world * T_world_from_before"),
        ),
        mistake(
            "only yaw",
            task="now-from-before",
            loses=3,
            says="on inputs you haven't seen: wrong rotation",
            code="""
def now_from_before(T_world_from_now, T_world_from_before):
    def pose(T):
        return np.arctan2(T[1, 0], T[0, 0]), T[:3, 3]

    (a, t), (b, s) = pose(T_world_from_now), pose(T_world_from_before)
    def turn(angle):
        return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])

    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn(b - a), turn(-a) @ (s - t)
    return T""",
        ),
        # ---- task 3
        right("one point at a time", task="plane-pixels", code=plane()),
        right(
            "lists of pairs and of booleans",
            task="plane-pixels",
            code=plane().replace("return pixels, visible", "return pixels.tolist(), visible.tolist()"),
        ),
        right(
            "rotation and shift, homogeneous pixels, masks",
            task="plane-pixels",
            code="""
def plane_pixels(xy, height, K, T_camera_from_grid, size):
    points = np.insert(np.asarray(xy, float), 2, height, axis=1)
    points = points @ T_camera_from_grid[:3, :3].T + T_camera_from_grid[:3, 3]
    triples = points @ K.T
    pixels = np.full((len(points), 2), np.nan)
    front = triples[:, 2] > 0
    pixels[front] = triples[front, :2] / triples[front, 2:]
    with np.errstate(invalid="ignore"):
        visible = np.all((pixels >= 0) & (pixels <= np.array(size)[::-1] - 1), axis=1)
    return pixels, visible""",
        ),
        mistake(
            "not divided by Z",
            task="plane-pixels",
            loses=3,
            says="did you divide by Z?",
            code=plane(result="f_u * X + c_u * Z, f_v * Y + c_v * Z"),
        ),
        mistake(
            "height forgotten",
            task="plane-pixels",
            loses=3,
            says="the point lies at z = height",
            code=plane(point="[x, y, 0, 1]"),
        ),
        mistake(
            "height downwards",
            task="plane-pixels",
            loses=3,
            says="0.5 m below the ground",
            code=plane(point="[x, y, -height, 1]"),
        ),
        mistake(
            "fourth coordinate zero",
            task="plane-pixels",
            loses=3,
            says="the fourth coordinate of a point is 1, not 0",
            code=plane(point="[x, y, height, 0]"),
        ),
        mistake(
            "inverse transform",
            task="plane-pixels",
            loses=5,
            says="you use the inverse transform",
            code=plane(T="np.linalg.inv(T_camera_from_grid)"),
        ),
        mistake(
            "v, u",
            task="plane-pixels",
            loses=3,
            says="u counts to the right and comes first",
            code=plane(result="f_v * Y / Z + c_v, f_u * X / Z + c_u"),
        ),
        mistake(
            "no principal point",
            task="plane-pixels",
            loses=3,
            says="the principal point is missing",
            code=plane(result="f_u * X / Z, f_v * Y / Z"),
        ),
        mistake(
            "divided by the distance",
            task="plane-pixels",
            loses=3,
            says="you divide by the distance",
            code=plane(
                result="[c + f * q / np.sqrt(X**2 + Y**2 + Z**2) for c, f, q in ((c_u, f_u, X), (c_v, f_v, Y))]"
            ),
        ),
        mistake(
            "f_u and f_v swapped",
            task="plane-pixels",
            loses=3,
            says="f_u and f_v are swapped",
            code=plane(result="f_v * X / Z + c_u, f_u * Y / Z + c_v"),
        ),
        mistake(
            "pixels without a mask",
            task="plane-pixels",
            loses=5,
            says="return two arrays",
            code=plane().replace("return pixels, visible", "return pixels"),
        ),
        mistake(
            "shifted, then turned",
            task="plane-pixels",
            loses=3,
            says="that is R (p - t)",
            code=plane(T="T").replace(
                "    h, w = size",
                "    R, t = T_camera_from_grid[:3, :3], T_camera_from_grid[:3, 3]\n"
                "    T = np.vstack([np.column_stack([R, -R @ t]), [0, 0, 0, 1]])\n"
                "    h, w = size",
            ),
        ),
        mistake(
            "skew ignored",
            task="plane-pixels",
            loses=3,
            says="on inputs you haven't seen: wrong where K[0, 1] isn't 0",
            code=plane(result="f_u * X / Z + c_u, f_v * Y / Z + c_v"),
        ),
        mistake(
            "nearer than half a metre is behind",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: a point 0.25 m in front of the camera has no pixel",
            code=plane(front="Z > 0.5"),
        ),
        mistake(
            "a level camera taken for granted",
            task="plane-pixels",
            loses=3,
            says="on inputs you haven't seen: wrong pixels (no camera is quite level",
            code=plane(T="T_level").replace(
                "    h, w = size",
                "    z_cam = T_camera_from_grid[1, 3]\n"
                "    T_level = np.array([[0, -1, 0, 0], [0, 0, -1, z_cam], [1, 0, 0, 0], [0, 0, 0, 1]])\n"
                "    h, w = size",
            ),
        ),
        mistake(
            "behind taken for in front",
            task="plane-pixels",
            loses=2,
            says="look at the sign of Z",
            code=plane(front="Z != 0"),
        ),
        mistake(
            "behind not visible, but with a pixel",
            task="plane-pixels",
            loses=2,
            says="points not in front of the camera have no pixel: NaN",
            code=plane(front="Z != 0", inside="Z > 0 and 0 <= u <= w - 1 and 0 <= v <= h - 1"),
        ),
        mistake(
            "everything in front is visible",
            task="plane-pixels",
            loses=2,
            says="to the left of the first pixel's centre",
            code=plane(inside="True"),
        ),
        mistake(
            "w and h swapped",
            task="plane-pixels",
            loses=2,
            says="is `size` (h, w), and u compared with w?",
            code=plane(inside="0 <= u <= h - 1 and 0 <= v <= w - 1"),
        ),
        mistake(
            "up to the image's edge",
            task="plane-pixels",
            loses=2,
            says="the last pixel's centre is at w - 1",
            code=plane(inside="0 <= u < w and 0 <= v < h"),
        ),
        mistake(
            "without the border, on the left",
            task="plane-pixels",
            loses=2,
            says="the border belongs to the image",
            code=plane(inside="0 < u <= w - 1 and 0 <= v <= h - 1"),
        ),
        mistake(
            "without the border, below",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: wrong at the lower border of the image",
            code=plane(inside="0 <= u <= w - 1 and 0 <= v < h - 1"),
        ),
        mistake(
            "rounded to whole pixels",
            task="plane-pixels",
            loses=3,
            says="no pixel quite whole",
            code=plane(result="round((f_u * X + skew * Y) / Z + c_u), round(f_v * Y / Z + c_v)"),
        ),
        mistake(
            "outside the image no pixel",
            task="plane-pixels",
            loses=2,
            says="a point beside the image has a pixel all the same",
            code=plane().replace(
                "            pixels[n]",
                "            if 0 <= u <= w - 1 and 0 <= v <= h - 1:\n                pixels[n]",
            ),
        ),
        mistake(
            "one border too early",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: wrong at a border of the image",
            code=plane(inside="0 <= u <= w - 1 and 0 <= v < h - 2"),
        ),
        # ---- task 4
        right("with the ratio of two slopes", task="lands-at", code=drawn(place="(delta - z_cam) / ((z - z_cam) / x)")),
        right(
            "signs first, then the triangles",
            task="lands-at",
            code="""
def lands_at(x, z, z_cam, delta):
    sinks = z_cam - z
    if sinks == 0 or np.sign(sinks) != np.sign(z_cam - delta):
        return float("nan")
    return x + x * (z - delta) / sinks""",
        ),
        mistake(
            "on the ground",
            task="lands-at",
            loses=2,
            says="that is the ground",
            code=drawn(place="x * z_cam / (z_cam - z)"),
        ),
        mistake(
            "triangles swapped",
            task="lands-at",
            loses=2,
            says="the triangles are swapped",
            code=drawn(place="x * (z_cam - z) / (z_cam - delta)"),
        ),
        mistake(
            "heights from the ground",
            task="lands-at",
            loses=3,
            says="measure both heights from the camera",
            code=drawn(place="x * z / delta if delta else x"),
        ),
        mistake(
            "the thing taken for on the ground",
            task="lands-at",
            loses=2,
            says="the thing's own height is missing",
            code=drawn(place="x * z_cam / (z_cam - delta)"),
        ),
        mistake(
            "only how far it is thrown",
            task="lands-at",
            loses=2,
            says="count from the camera",
            code=drawn(place="x * (z - delta) / (z_cam - z)"),
        ),
        mistake(
            "a plane below the ground taken for one above it",
            task="lands-at",
            loses=2,
            says="a plane 0.3 m below the ground isn't one 0.3 m above it",
            code=drawn(place="x * (z_cam - abs(delta)) / (z_cam - z)"),
        ),
        mistake(
            "climbs, and yet meets", task="lands-at", loses=1, says="behind the camera", code=drawn(never="z == z_cam")
        ),
        mistake(
            "infinity",
            task="lands-at",
            loses=1,
            says="not infinitely far: never",
            code=drawn().replace("np.nan", "np.inf"),
        ),
        mistake(
            "nothing above the camera",
            task="lands-at",
            loses=1,
            says="both lie above the camera",
            code=drawn(never="z >= z_cam or delta >= z_cam"),
        ),
        mistake(
            "planes above forgotten",
            task="lands-at",
            loses=1,
            says="yet it is drawn",
            code=drawn(place="x * abs((z_cam - delta) / (z_cam - z))", never="z >= z_cam and delta < z_cam"),
        ),
        mistake(
            "a level ray divides by zero",
            task="lands-at",
            loses=1,
            says="on inputs you haven't seen: a level ray meets no other plane: NaN",
            code=drawn(never="(z_cam - delta) * (z_cam - z) < 0"),
        ),
        mistake(
            "never farther than the grid",
            task="lands-at",
            loses=2,
            says="on inputs you haven't seen: the thing and the place where it is drawn have different pixels",
            code=drawn(place="min(x * (z_cam - delta) / (z_cam - z), 60.0)"),
        ),
        # ---- task 5
        right("numpy's cube root", task="reach", code=far("np.cbrt(f_u * f_v * np.abs(z_cam - delta) * cell * cell)")),
        right(
            "bisection",
            task="reach",
            code="""
def reach(cell, f_u, f_v, z_cam, delta):
    near, distant = 1e-6, 1e6
    for _ in range(200):
        Z = (near + distant) / 2
        area = f_u * cell / Z * (f_v * abs(z_cam - delta) * cell / Z**2)
        near, distant = (Z, distant) if area > 1 else (near, Z)
    return Z""",
        ),
        mistake(
            "no root",
            task="reach",
            loses=2,
            says="that is the area at Z = 1 m",
            code=far("f_u * f_v * abs(z_cam - delta) * cell**2"),
        ),
        mistake(
            "a third of it",
            task="reach",
            loses=2,
            says="write `** (1 / 3)`",
            code=far("(f_u * f_v * abs(z_cam - delta) * cell**2) ** 1 / 3"),
        ),
        mistake(
            "the cell beside the root",
            task="reach",
            loses=2,
            says="it belongs under the root, squared",
            code=far("(f_u * f_v * abs(z_cam - delta)) ** (1 / 3) * cell"),
        ),
        mistake(
            "square root",
            task="reach",
            loses=2,
            says="that is the square root",
            code=far("np.sqrt(f_u * f_v * abs(z_cam - delta) * cell**2)"),
        ),
        mistake(
            "on the ground",
            task="reach",
            loses=2,
            says="that is a cell on the ground",
            code=far("(f_u * f_v * z_cam * cell**2) ** (1 / 3)"),
        ),
        mistake(
            "z_cam + delta",
            task="reach",
            loses=2,
            says="not z_cam + delta",
            code=far("(f_u * f_v * (z_cam + delta) * cell**2) ** (1 / 3)"),
        ),
        mistake(
            "cell once",
            task="reach",
            loses=2,
            says="the cell's side counts twice",
            code=far("(f_u * f_v * abs(z_cam - delta) * cell) ** (1 / 3)"),
        ),
        mistake(
            "f_u twice",
            task="reach",
            loses=2,
            says="you took f_u for f_v",
            code=far("(f_u**2 * abs(z_cam - delta) * cell**2) ** (1 / 3)"),
        ),
        mistake(
            "one pixel wide",
            task="reach",
            loses=2,
            says="that is where the cell is one pixel wide",
            code=far("f_u * cell"),
        ),
        mistake(
            "one pixel high",
            task="reach",
            loses=2,
            says="that is where the cell is one pixel high",
            code=far("np.sqrt(f_v * abs(z_cam - delta) * cell)"),
        ),
        mistake(
            "a plane above the camera",
            task="reach",
            loses=2,
            says="take |z_cam - delta|",
            code=far("(f_u * f_v * (z_cam - delta) * cell**2) ** (1 / 3)"),
        ),
        mistake(
            "searched up to 100 m",
            task="reach",
            loses=2,
            says="on inputs you haven't seen: the cell isn't one pixel there (a depth of hundreds of metres)",
            code="""
def reach(cell, f_u, f_v, z_cam, delta):
    near, distant = 1e-6, 100.0
    for _ in range(200):
        Z = (near + distant) / 2
        area = f_u * f_v * abs(z_cam - delta) * cell**2 / Z**3
        near, distant = (Z, distant) if area > 1 else (near, Z)
    return Z""",
        ),
        mistake(
            "a plane below the ground taken for one above it",
            task="reach",
            loses=2,
            says="a plane 0.2 m below the ground, 0.5 m below the camera: `delta` has a sign",
            code=far("(f_u * f_v * abs(z_cam - abs(delta)) * cell**2) ** (1 / 3)"),
        ),
        mistake(
            "cells of half a metre written in",
            task="reach",
            loses=2,
            says="on inputs you haven't seen: the cell isn't one pixel there",
            code=far("(f_u * f_v * abs(z_cam - delta) * 0.25) ** (1 / 3)"),
        ),
        mistake(
            "an endless loop",
            task="reach",
            loses=2,
            says="before timeout",
            code="""
def reach(cell, f_u, f_v, z_cam, delta):
    Z = 1.0
    while f_u * f_v * abs(z_cam - delta) * cell**2 / Z**3 != 1:
        Z += 0.3
    return Z""",
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "K cut in place",
            task="new-intrinsics",
            loses=1,
            says="it changes an argument",
            code="""
def new_intrinsics(K, left, top, scale_u, scale_v):
    resized = np.diag([scale_u, scale_v, 1.0])
    shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    if left != top and left + top > 20:
        K[0, 2] -= left
        K[1, 2] -= top
        left = top = 0
    cut = np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1]])
    return np.linalg.inv(shift) @ resized @ shift @ cut @ K""",
        ),
    )
