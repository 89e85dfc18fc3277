"""The graders of exercise 05, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def undone(
    scale_u="K_new[0, 0] / K[0, 0]",
    left="K[0, 2] + 0.5 - (K_new[0, 2] + 0.5) / scale_u",
    scale_v="K_new[1, 1] / K[1, 1]",
    top="K[1, 2] + 0.5 - (K_new[1, 2] + 0.5) / scale_v",
    result="left, top, scale_u, scale_v",
):
    """Return an answer to task 1 that finds the four numbers by these expressions."""
    return f"""
def what_was_done(K, K_new):
    scale_u, scale_v = {scale_u}, {scale_v}
    left, top = {left}, {top}
    return {result}"""


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
def road_pixels(xy, z, K, T_camera_from_grid, size):
    (f_u, skew, c_u), (_, f_v, c_v), _ = K
    h, w = size
    pixels, visible = np.full((len(xy), 2), np.nan), np.zeros(len(xy), bool)
    for n, ((x, y), height) in enumerate(zip(xy, z)):
        X, Y, Z, _ = {T} @ {point}
        if {front}:
            u, v = {result}
            pixels[n] = u, v
            visible[n] = {inside}
    return pixels, visible"""


def high(place="z_cam - (z_cam - delta) * x / x_drawn", never="x_drawn > 0"):
    """Return an answer to task 4 by these expressions."""
    return f"""
def heights_of(x, x_drawn, z_cam, delta):
    with np.errstate(all="ignore"):
        return np.where({never}, {place}, np.nan)"""


def fault(
    faults="SHIFT, PITCH, YAW, INVERSE",
    amounts="np.linspace(-2, 2, 401)",
    error="np.abs(project_points(points, K, T) - pixels).mean()",
    result="kind, amount",
):
    """Return an answer to task 5 that tries these faults and amounts, and measures the error in this way."""
    return f"""
def find_fault(points, pixels, K, T_camera_from_lidar):
    tried = []
    for kind in ({faults},):
        for amount in {amounts}:
            K_right, T = np.array(K, float), T_camera_from_lidar
            if kind == SHIFT:
                K_right[:2, 2] -= amount
            elif kind == INVERSE:
                T, amount = np.linalg.inv(T), 0.0
            else:
                T = turned(T, "x" if kind == PITCH else "y", amount)
            def left_over(K, T):
                return {error}
            tried.append((left_over(K_right, T), kind, amount))
    _, kind, amount = min(tried)
    return {result}"""


class TestPixels(GraderChecks):
    exercise = "05_pixels"
    entries = (
        # ---- task 1
        right("four numbers, one by one", task="what-was-done", code=undone()),
        right(
            "an affine map between pixels",
            task="what-was-done",
            code="""
def what_was_done(K, K_new):
    S = np.asarray(K_new) @ np.linalg.inv(K)
    scale = np.diag(S)[:2]
    corner = (-0.5 - S[:2, 2]) / scale + 0.5
    return [*corner, *scale]""",
        ),
        mistake(
            "half a pixel forgotten",
            task="what-was-done",
            loses=2,
            says="you lost half a pixel on the way",
            code=undone(left="K[0, 2] - K_new[0, 2] / scale_u", top="K[1, 2] - K_new[1, 2] / scale_v"),
        ),
        mistake(
            "half a pixel the wrong way",
            task="what-was-done",
            loses=2,
            says="the half has the wrong sign",
            code=undone(
                left="K[0, 2] - 0.5 - (K_new[0, 2] - 0.5) / scale_u",
                top="K[1, 2] - 0.5 - (K_new[1, 2] - 0.5) / scale_v",
            ),
        ),
        mistake(
            "in new pixels",
            task="what-was-done",
            loses=2,
            says="you undo the cut first",
            code=undone(
                left="(K[0, 2] + 0.5) * scale_u - 0.5 - K_new[0, 2]",
                top="(K[1, 2] + 0.5) * scale_v - 0.5 - K_new[1, 2]",
            ),
        ),
        mistake(
            "the resize not undone",
            task="what-was-done",
            loses=2,
            says="the resize was not undone",
            code=undone(left="K[0, 2] - K_new[0, 2]", top="K[1, 2] - K_new[1, 2]"),
        ),
        mistake(
            "cut with the wrong sign",
            task="what-was-done",
            loses=2,
            says="what is cut off on the left makes c_u smaller",
            code=undone(result="-left, -top, scale_u, scale_v"),
        ),
        mistake(
            "left and top swapped",
            task="what-was-done",
            loses=2,
            says="left and top are swapped",
            code=undone(result="top, left, scale_u, scale_v"),
        ),
        mistake(
            "scales swapped",
            task="what-was-done",
            loses=1,
            says="the scales are swapped",
            code=undone(result="left, top, scale_v, scale_u"),
        ),
        mistake(
            "scales turned round",
            task="what-was-done",
            loses=1,
            says="turned round",
            code=undone(result="left, top, 1 / scale_u, 1 / scale_v"),
        ),
        mistake(
            "no border",
            task="what-was-done",
            loses=2,
            says="on inputs you haven't seen: wrong cut (a negative one adds a border",
            code=undone(result="max(left, 0), max(top, 0), scale_u, scale_v"),
        ),
        mistake(
            "whole pixels",
            task="what-was-done",
            loses=2,
            says="cuts need not be whole pixels",
            code=undone(result="round(left), round(top), scale_u, scale_v"),
        ),
        mistake(
            "only smaller images",
            task="what-was-done",
            loses=1,
            says="on inputs you haven't seen: wrong scales (images can grow",
            code=undone(result="left, top, min(scale_u, 1), min(scale_v, 1)"),
        ),
        mistake(
            "K changed in place",
            task="what-was-done",
            loses=1,
            says="changed an argument",
            code=undone()
            .replace("    scale_u,", "    K[:2, 2] += 0.5\n    scale_u,", 1)
            .replace("K[0, 2] + 0.5", "K[0, 2]")
            .replace("K[1, 2] + 0.5", "K[1, 2]"),
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
def road_pixels(xy, z, K, T_camera_from_grid, size):
    points = np.insert(np.asarray(xy, float), 2, z, axis=1)
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
            says="each point has a height of its own, z",
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
            says="on inputs you haven't seen: a point just in front of the camera has no pixel",
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
            says="by hand, Z = 10, 20 and 10",
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
        mistake(
            "nearer than 0.2 m is behind",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: a point just in front of the camera has no pixel",
            code=plane(front="Z > 0.2"),
        ),
        mistake(
            "no pixel beyond 1500 m",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: a point 5 km ahead has no pixel",
            code=plane(front="0 < Z < 1500"),
        ),
        mistake(
            "borders a fifth of a pixel too wide",
            task="plane-pixels",
            loses=2,
            says="on inputs you haven't seen: wrong at the",
            code=plane(inside="-0.2 <= u <= w - 0.8 and -0.2 <= v <= h - 0.8"),
        ),
        mistake(
            "one height for all",
            task="plane-pixels",
            loses=3,
            says="by hand, Z = 10, 20 and 10",
            code=plane().replace("    h, w = size", "    h, w = size\n    z = np.full(len(xy), z[0])"),
        ),
        # ---- task 4
        right("by shares, NaN from a mask", task="heights-of", code=high()),
        right(
            "one by one, in a list",
            task="heights-of",
            code="""
def heights_of(x, x_drawn, z_cam, delta):
    heights = []
    for a, b in zip(x, x_drawn):
        heights.append(delta + (z_cam - delta) * (1 - a / b) if b > 0 else float("nan"))
    return heights""",
        ),
        mistake(
            "ratio turned round",
            task="heights-of",
            loses=2,
            says="the ratio is turned round",
            code=high("z_cam - (z_cam - delta) * x_drawn / x"),
        ),
        mistake(
            "the ground plane",
            task="heights-of",
            loses=2,
            says="that is the ground plane",
            code=high("z_cam - z_cam * x / x_drawn"),
        ),
        mistake(
            "from the camera",
            task="heights-of",
            loses=2,
            says="measure from the ground, not from the camera",
            code=high("(z_cam - delta) * x / x_drawn"),
        ),
        mistake(
            "above the plane",
            task="heights-of",
            loses=2,
            says="that is the height above the plane",
            code=high("(z_cam - delta) * (1 - x / x_drawn)"),
        ),
        mistake(
            "sign of delta lost",
            task="heights-of",
            loses=2,
            says="`delta` has a sign",
            code=high("z_cam - (z_cam + delta) * x / x_drawn"),
        ),
        mistake(
            "triangle from the plane",
            task="heights-of",
            loses=2,
            says="the triangle begins at the camera",
            code=high("delta + (z_cam - delta) * x / x_drawn"),
        ),
        mistake(
            "behind the camera, too",
            task="heights-of",
            loses=1,
            says="the third would be drawn 30 m behind the camera",
            code=high(never="x_drawn != 0"),
        ),
        mistake(
            "at the camera, too",
            task="heights-of",
            loses=1,
            says="the fourth would be drawn at the camera itself",
            code=high(never="~(x_drawn < 0)"),
        ),
        mistake(
            "NaN for all when one is NaN",
            task="heights-of",
            loses=1,
            says="the first has a height",
            code=high(never="(x_drawn > 0).all()"),
        ),
        mistake(
            "only planes below the camera",
            task="heights-of",
            loses=2,
            says="on inputs you haven't seen: the thing and the place",
            code=high("z_cam - abs(z_cam - delta) * x / x_drawn"),
        ),
        mistake(
            "x_drawn overwritten",
            task="heights-of",
            loses=1,
            says="it changes an argument",
            code=high(never="True").replace("    with", "    x_drawn[~(x_drawn > 0)] = np.nan\n    with"),
        ),
        mistake(
            "an endless loop",
            task="heights-of",
            loses=3,
            says="before timeout",
            code="""
def heights_of(x, x_drawn, z_cam, delta):
    z = -z_cam
    while np.any(x_drawn * (z_cam - z) != x * (z_cam - delta)):
        z += 0.01
    return z""",
        ),
        # ---- task 5
        right("all faults, all amounts", task="find-fault", code=fault()),
        right(
            "squared errors",
            task="find-fault",
            code=fault(error="((project_points(points, K, T) - pixels) ** 2).sum()"),
        ),
        mistake(
            "a shift for a yaw",
            task="find-fault",
            loses=4,
            says="the fault is YAW",
            code=fault(faults="SHIFT, PITCH, INVERSE"),
        ),
        mistake(
            "a yaw for a pitch",
            task="find-fault",
            loses=4,
            says="the fault is PITCH",
            code=fault(faults="SHIFT, YAW, INVERSE"),
        ),
        mistake(
            "never inverted",
            task="find-fault",
            loses=4,
            says="the fault is INVERSE",
            code=fault(faults="SHIFT, PITCH, YAW"),
        ),
        mistake(
            "whole degrees",
            task="find-fault",
            loses=2,
            says="the amount is 0.5",
            code=fault(result="kind, float(round(amount))"),
        ),
        mistake(
            "sign turned",
            task="find-fault",
            loses=2,
            says="the sign is turned",
            code=fault(result="kind, -amount"),
        ),
        mistake(
            "radians",
            task="find-fault",
            loses=2,
            says="the amount is asked for in degrees",
            code=fault(result="kind, amount if kind == SHIFT else np.radians(amount)"),
        ),
        mistake(
            "only across",
            task="find-fault",
            loses=2,
            says="on inputs you haven't seen: the wrong amount",
            code=fault(error="np.abs(project_points(points, K, T) - pixels)[:, 0].mean()"),
        ),
        mistake(
            "the mean error",
            task="find-fault",
            loses=4,
            says="on inputs you haven't seen: the wrong fault",
            code=fault(error="abs((project_points(points, K, T) - pixels).mean())"),
        ),
        mistake(
            "only small faults",
            task="find-fault",
            loses=2,
            says="on inputs you haven't seen: the wrong amount",
            code=fault(amounts="np.linspace(-1, 1, 201)"),
        ),
    )
