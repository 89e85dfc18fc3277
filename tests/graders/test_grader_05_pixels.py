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


def walls(
    ray="z_cam + (delta - z_cam) * x[i] / x[j]",
    order="range(len(x))",
    meets="top[i] >= ray",
    none="len(x)",
    before="",
    count="np.sum(shown(x, top, z_cam, delta) == np.arange(len(x)))",
    choose="np.argmax(counts)",
):
    """Return an answer to task 3 that follows one ray at a time by these expressions."""
    return f"""
def shown(x, top, z_cam, delta):
    {before or "pass"}
    firsts = []
    for j in range(len(x)):
        firsts.append({none})
        for i in {order}:
            ray = {ray}
            if {meets}:
                firsts[-1] = i
                break
    return np.array(firsts)


def best_plane(x, top, z_cam, heights):
    counts = [{count} for delta in heights]
    return {choose}"""


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


def mended(
    found="find(points, pixels, K, T_camera_from_lidar)",
    shift="-amount",
    turn="amount",
    inverse="np.linalg.inv(T_camera_from_lidar)",
    before="",
    result="K_right, T",
):
    """Return an answer to task 6 that repairs each fault by these expressions."""
    return f"""
def repaired(points, pixels, K, T_camera_from_lidar, find=None):
    {before or "pass"}
    kind, amount = {found}
    K_right, T = np.array(K, float), T_camera_from_lidar
    if kind == SHIFT:
        K_right[:2, 2] += {shift}
    elif kind == INVERSE:
        T = {inverse}
    else:
        T = turned(T, "x" if kind == PITCH else "y", {turn})
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
        right("one ray at a time", task="shown", code=walls()),
        right(
            "slopes from the camera",
            task="shown",
            code="""
def shown(x, top, z_cam, delta):
    slopes = (np.asarray(top) - z_cam) / x
    firsts = [np.flatnonzero(slopes >= (delta - z_cam) / far) for far in x]
    return [int(first[0]) if len(first) else len(x) for first in firsts]


def best_plane(x, top, z_cam, heights):
    best, most = 0, -1
    for number, delta in enumerate(heights):
        in_place = sum(j == wall for j, wall in enumerate(shown(x, top, z_cam, delta)))
        if in_place > most:
            best, most = number, in_place
    return best""",
        ),
        mistake(
            "equation (1) alone", task="shown", loses=5, says="equation (1) alone", code=walls(order="[j]", none="j")
        ),
        mistake(
            "nothing flies over",
            task="shown",
            loses=5,
            says="nothing flies over in your answer",
            code=walls(order="range(j)", none="j"),
        ),
        mistake(
            "nothing is hidden",
            task="shown",
            loses=5,
            says="nothing is hidden in your answer",
            code=walls(order="range(j, len(x))"),
        ),
        mistake(
            "walls against the plane",
            task="shown",
            loses=5,
            says="you compare the walls with the plane",
            code=walls(ray="delta"),
        ),
        mistake(
            "the last wall",
            task="shown",
            loses=5,
            says="that is the last wall",
            code=walls(order="reversed(range(len(x)))"),
        ),
        mistake(
            "walls against one another",
            task="shown",
            loses=5,
            says="a higher wall in front doesn't hide all behind it",
            code=walls(order="range(j)", meets="top[i] > top[j]", none="j"),
        ),
        mistake(
            "counted from 1",
            task="shown",
            loses=5,
            says="count the cells from 0",
            code=walls().replace("return np.array(firsts)", "return np.minimum(np.array(firsts) + 1, len(x))"),
        ),
        mistake(
            "no wall is number 0",
            task="shown",
            loses=3,
            says="the rays meet no wall, and the number is N = 5",
            code=walls(none="0"),
        ),
        mistake(
            "the ground plane, always",
            task="shown",
            loses=5,
            says="a plane at 1 m",
            code=walls(ray="z_cam - z_cam * x[i] / x[j]"),
        ),
        mistake(
            "top changed in place",
            task="shown",
            loses=3,
            says="shown changed an argument",
            code=walls(before="top -= z_cam", ray="(delta - z_cam) * x[i] / x[j]").replace(
                "shown(x, top, z_cam, delta) ==", "shown(x, top.copy(), z_cam, delta) =="
            ),
        ),
        mistake(
            "every plane below the camera",
            task="shown",
            loses=3,
            says="on inputs you haven't seen: a wrong wall, on a plane above the camera",
            code=walls(ray="z_cam - abs(delta - z_cam) * x[i] / x[j]"),
        ),
        mistake(
            "no wall higher than the camera",
            task="shown",
            loses=5,
            says="on inputs you haven't seen: a wrong wall",
            code=walls(meets="z_cam > top[i] >= ray"),
        ),
        mistake(
            "the height of the plane",
            task="shown",
            loses=2,
            says="return the number of the plane, not its height",
            code=walls(choose="heights[np.argmax(counts)]"),
        ),
        mistake(
            "not hidden is enough",
            task="shown",
            loses=2,
            says="return 1, the first of these",
            code=walls(count="np.sum(shown(x, top, z_cam, delta) >= np.arange(len(x)))"),
        ),
        mistake(
            "not flown over is enough",
            task="shown",
            loses=2,
            says="a cell must be seen IN PLACE to count",
            code=walls(count="np.sum(shown(x, top, z_cam, delta) <= np.arange(len(x)))"),
        ),
        mistake(
            "the last of the best",
            task="shown",
            loses=2,
            says="return 1, the first of these",
            code=walls(choose="len(counts) - 1 - np.argmax(counts[::-1])"),
        ),
        mistake(
            "the lowest of the best",
            task="shown",
            loses=2,
            says="on inputs you haven't seen: an earlier plane is as good",
            code=walls(choose="min(range(len(counts)), key=lambda k: (-counts[k], heights[k] if k > 3 else k))"),
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
        # ---- task 6
        right("the table of task 5", task="repaired", code=mended()),
        right(
            "a search of one's own",
            task="repaired",
            code="""
def repaired(points, pixels, K, T_camera_from_lidar, find=None):
    T = T_camera_from_lidar
    best = [(K, np.linalg.inv(T))]
    for amount in np.arange(-2, 2.005, 0.01):
        shifted = np.array(K, float)
        shifted[:2, 2] -= amount
        best += [(shifted, T), (K, turned(T, "x", amount)), (K, turned(T, "y", amount))]
    return min(best, key=lambda both: np.nan_to_num(np.abs(project_points(points, *both) - pixels), nan=1e9).sum())""",
        ),
        mistake(
            "found, but not repaired",
            task="repaired",
            loses=3,
            says="nothing was repaired",
            code=mended(result="K, T_camera_from_lidar"),
        ),
        mistake("turned the wrong way", task="repaired", loses=3, says="it has grown", code=mended(turn="-amount")),
        mistake(
            "shifted the wrong way",
            task="repaired",
            loses=3,
            says="fault SHIFT: it has grown",
            code=mended(shift="amount"),
        ),
        mistake(
            "the inverse forgotten",
            task="repaired",
            loses=3,
            says="fault INVERSE: nothing was repaired",
            code=mended(inverse="T"),
        ),
        mistake("T alone", task="repaired", loses=3, says="return two matrices", code=mended(result="T")),
        mistake(
            "K changed in place",
            task="repaired",
            loses=3,
            says="repaired changed an argument",
            code=mended(result="K, T").replace("np.array(K, float)", "K"),
        ),
        mistake(
            "half a degree at a time",
            task="repaired",
            loses=3,
            says="a return is seen up to",
            code=mended(turn="round(2 * amount) / 2"),
        ),
        mistake(
            "only what the visible test asks",
            task="repaired",
            loses=3,
            says="on inputs you haven't seen: a return that nobody clicked",
            code=mended(turn="abs(amount) if kind == PITCH else -abs(amount)"),
        ),
    )
