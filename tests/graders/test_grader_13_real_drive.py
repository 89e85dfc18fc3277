"""The graders of exercise 13, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def gaps(condition="step > 1.5 * usual", usual="np.median(steps)", result="k"):
    """Return an answer to task 1 with these parts."""
    return f"""
def find_gaps(times):
    steps = [b - a for a, b in zip(times[:-1], times[1:])]
    usual = {usual}
    return [{result} for k, step in enumerate(steps) if {condition}]"""


def share(
    ahead="points[:, 0] > 0",
    inside="(Z > 0) & (u >= 0) & (v >= 0) & (u <= size[1] - 1) & (v <= size[0] - 1)",
    result="inside.sum() / len(chosen)",
    moved="chosen @ T[:3, :3].T + T[:3, 3]",
    u="K[0, 0] * X / Z + K[0, 2]",
):
    """Return an answer to task 2 with these parts."""
    return f"""
def share_on_image(points, T, K, size):
    chosen = points[{ahead}]
    X, Y, Z = ({moved}).T
    u, v = {u}, K[1, 1] * Y / Z + K[1, 2]
    inside = {inside}
    return {result}"""


def plane(
    result="-a, np.degrees(np.arctan(b))",
    columns="np.ones(len(x)), x, y",
    rounds="30",
    keep="np.abs(off) < max(0.05, np.quantile(np.abs(off), 0.6))",
):
    """Return an answer to task 3 with these parts."""
    return f"""
def ground(points):
    x, y, z = points.T
    use = np.ones(len(x), bool)
    for _ in range({rounds}):
        A = np.column_stack([{columns}])
        a, b, c = np.linalg.lstsq(A[use], z[use], rcond=None)[0]
        off = z - A @ [a, b, c]
        use = {keep}
    return {result}"""


def laid(moved="now @ T[:3, :3].T + T[:3, 3]", onto="before", query="moved", result="np.median(d)"):
    """Return an answer to task 4 with these parts."""
    return f"""
def overlay(before, now, T):
    from scipy.spatial import cKDTree
    moved = {moved}
    d = cKDTree({onto}).query({query})[0]
    return {result}"""


def diagnose(
    lost="len(time_gaps([f.time for f in frames])) > 0",
    tilted="abs(rise) > 1",
    backwards="overlay_error(a, b, T) > 2 * overlay_error(a, b, np.linalg.inv(T))",
    turned="abs(best) >= 1",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def find_fault(frames):
    a, b = frames[1], frames[6]
    rise = ground_plane(frames[-1].points, 1.73).pitch
    T = motion_between(a, b)
    turns = np.arange(-3, 3.5, 0.5)
    best = turns[sum(edge_contrast(f, turns) for f in frames[::3]).argmax()]
    if {lost}:
        return "two frames lost"
    if {tilted}:
        return "LIDAR tilted"
    if {backwards}:
        return "poses backwards"
    return "camera turned" if {turned} else "none\""""


class TestRealDrive(GraderChecks):
    exercise = "13_real_drive"
    entries = (
        # ---- task 1
        right("a loop and a list", task="find-gaps", code=gaps()),
        right(
            "sorted steps, an array of numbers",
            task="find-gaps",
            code="""
def find_gaps(times):
    steps = np.diff(np.asarray(times))
    return np.array([k for k in range(len(steps)) if steps[k] / sorted(steps)[len(steps) // 2] > 1.5], int)""",
        ),
        mistake(
            "the frame after", task="find-gaps", loses=2, says="the frame after the gap", code=gaps(result="k + 1")
        ),
        mistake("the mean", task="find-gaps", loses=2, says="pull up the mean", code=gaps(usual="np.mean(steps)")),
        mistake("the wrong way", task="find-gaps", loses=2, says="wrong way round", code=gaps("step < 1.5 * usual")),
        mistake(
            "returns steps", task="find-gaps", loses=2, says="you return steps", code=gaps(result="round(step, 6)")
        ),
        mistake(
            "returns a mask",
            task="find-gaps",
            loses=2,
            says="True or False",
            code="def find_gaps(times):\n    return np.diff(times) > 1.5 * np.median(np.diff(times))",
        ),
        mistake(
            "only twice as long", task="find-gaps", loses=2, says="only the longest", code=gaps("step > 2.5 * usual")
        ),
        mistake("no return", task="find-gaps", loses=2, says="forget `return`", code="def find_gaps(times):\n    pass"),
        mistake(
            "ten a second, always",
            task="find-gaps",
            loses=2,
            says="on inputs you haven't seen",
            code=gaps("step > 0.15"),
        ),
        mistake(
            "the first step as the measure",
            task="find-gaps",
            loses=2,
            says="on inputs you haven't seen",
            code=gaps(usual="steps[0]"),
        ),
        mistake(
            "an endless loop",
            task="find-gaps",
            loses=2,
            says="before timeout",
            code="def find_gaps(times):\n    while True:\n        pass",
        ),
        # ---- task 2
        right("axis by axis", task="share-on-image", code=share()),
        right(
            "homogeneous coordinates, a loop",
            task="share-on-image",
            code="""
def share_on_image(points, T, K, size):
    seen = []
    for x, y, z in points:
        if x > 0:
            p = K @ (T @ [x, y, z, 1])[:3]
            seen.append(p[2] > 0 and 0 <= p[0] / p[2] <= size[1] - 1 and 0 <= p[1] / p[2] <= size[0] - 1)
    return sum(seen) / len(seen)""",
        ),
        mistake(
            "all returns below the line",
            task="share-on-image",
            loses=2,
            says="number of all returns",
            code=share(result="inside.sum() / len(points)"),
        ),
        mistake(
            "behind counts",
            task="share-on-image",
            loses=2,
            says="check Z > 0",
            code=share(inside="(u >= 0) & (v >= 0) & (u <= size[1] - 1) & (v <= size[0] - 1)"),
        ),
        mistake(
            "ahead of the camera alone",
            task="share-on-image",
            loses=2,
            says="between LIDAR and camera",
            code=share(ahead="(points @ T[:3, :3].T + T[:3, 3])[:, 2] > 0"),
        ),
        mistake(
            "height and width swapped",
            task="share-on-image",
            loses=2,
            says="size is (height, width)",
            code=share(inside="(Z > 0) & (u >= 0) & (v >= 0) & (u <= size[0] - 1) & (v <= size[1] - 1)"),
        ),
        mistake(
            "no lower limits",
            task="share-on-image",
            loses=2,
            says="lower limits are missing",
            code=share(inside="(Z > 0) & (u <= size[1] - 1) & (v <= size[0] - 1)"),
        ),
        mistake(
            "only u",
            task="share-on-image",
            loses=2,
            says="v is never checked",
            code=share(inside="(Z > 0) & (u >= 0) & (u <= size[1] - 1)"),
        ),
        mistake(
            "no number",
            task="share-on-image",
            loses=2,
            says="share_on_image returned no array of numbers but a str",
            code=share(result="'40 %'"),
        ),
        mistake(
            "a number, no share",
            task="share-on-image",
            loses=2,
            says="divide by the number",
            code=share(result="inside.sum()"),
        ),
        mistake(
            "the rotation transposed",
            task="share-on-image",
            loses=2,
            says="the right way round",
            code=share(moved="chosen @ T[:3, :3] + T[:3, 3]"),
        ),
        mistake(
            "the principal point in the middle",
            task="share-on-image",
            loses=2,
            says="on inputs you haven't seen",
            code=share(u="K[0, 0] * X / Z + (size[1] - 1) / 2"),
        ),
        # ---- task 3
        right("least squares, the best three fifths again", task="ground", code=plane()),
        right(
            "many planes through three returns, the one with most friends",
            task="ground",
            code="""
def ground(points):
    rng, best, friends = np.random.default_rng(0), None, -1
    A, z = np.column_stack([np.ones(len(points)), points[:, :2]]), points[:, 2]
    for _ in range(300):
        some = rng.choice(len(points), 3, replace=False)
        if abs(np.linalg.det(A[some])) > 1e-3:
            near = abs(A @ np.linalg.solve(A[some], z[some]) - z) < 0.04
            if near.sum() > friends:
                best, friends = near, near.sum()
    a, b, c = np.linalg.lstsq(A[best], z[best], rcond=None)[0]
    return [-a, np.degrees(np.arctan(b))]""",
        ),
        mistake(
            "a negative height",
            task="ground",
            loses=2,
            says="height is negative",
            code=plane("a, np.degrees(np.arctan(b))"),
        ),
        mistake("the slope", task="ground", loses=2, says="degrees are asked for", code=plane("-a, b")),
        mistake("radians", task="ground", loses=2, says="degrees are asked for", code=plane("-a, np.arctan(b)")),
        mistake(
            "down is up", task="ground", loses=2, says="sign is swapped", code=plane("-a, -np.degrees(np.arctan(b))")
        ),
        mistake("x and y", task="ground", loses=2, says="order of x and y", code=plane("-a, np.degrees(np.arctan(c))")),
        mistake(
            "the mean height",
            task="ground",
            loses=3,
            says="mean height",
            code=plane("-z.mean(), np.degrees(np.arctan(b))"),
        ),
        mistake(
            "the same numbers on every road",
            task="ground",
            loses=3,
            says="on a road 0.3 m higher up the height is the same",
            code="def ground(points):\n    return 1.7, 0.573",
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="ground",
            code="""
road, height, rise, T, K, frames, wrong, nearest = "these were names of the test cells, too".split()


def got(before):
    return [before[0], [float(number) for number in before[1:]]]


"""
            + plane("[[-a], [np.degrees(np.arctan(b))]]"),
        ),
        mistake("cars are ground", task="ground", loses=1, says="with a car on the road", code=plane(rounds="1")),
        mistake(
            "what lies below 1.21 m is road",
            task="ground",
            loses=1,
            says="on inputs you haven't seen",
            code="""
def ground(points):
    x, y, z = points[points[:, 2] < -1.21].T
    a, b, c = np.linalg.lstsq(np.column_stack([np.ones(len(x)), x, y]), z, rcond=None)[0]
    return -a, np.degrees(np.arctan(b))""",
        ),
        # ---- task 4
        right("a tree", task="overlay", code=laid()),
        right(
            "a loop over returns",
            task="overlay",
            code="""
def overlay(before, now, T):
    homogeneous = np.c_[now, np.ones(len(now))] @ T.T
    return np.median([np.linalg.norm(before - p, axis=1).min() for p in homogeneous[:, :3]])""",
        ),
        mistake("the mean", task="overlay", loses=3, says="that is the mean", code=laid(result="d.mean()")),
        mistake(
            "the inverse",
            task="overlay",
            loses=3,
            says="you move by the inverse",
            code=laid("now @ np.linalg.inv(T)[:3, :3].T + np.linalg.inv(T)[:3, 3]"),
        ),
        mistake("nothing moved", task="overlay", loses=3, says="nothing is moved", code=laid("now")),
        mistake("no rotation", task="overlay", loses=3, says="rotation is missing", code=laid("now + T[:3, 3]")),
        mistake("no shift", task="overlay", loses=3, says="shift is missing", code=laid("now @ T[:3, :3].T")),
        mistake("transposed", task="overlay", loses=3, says="transposed", code=laid("now @ T[:3, :3] + T[:3, 3]")),
        mistake(
            "from before to now",
            task="overlay",
            loses=3,
            says="you go from before to now",
            code=laid(onto="moved", query="before"),
        ),
        mistake("squares", task="overlay", loses=3, says="squared", code=laid(result="np.median(d**2)")),
        mistake(
            "seen from above",
            task="overlay",
            loses=3,
            says="three dimensions",
            code=laid(onto="before[:, :2]", query="moved[:, :2]"),
        ),
        mistake("all distances", task="overlay", loses=3, says="return one number", code=laid(result="d")),
        mistake(
            "the middle of the unsorted list",
            task="overlay",
            loses=3,
            says="on inputs you haven't seen",
            code=laid(result="d[len(d) // 2]"),
        ),
        # ---- task 5
        right("other frames, other limits", task="find-fault", code=diagnose()),
        right(
            "every reading first, then the largest",
            task="find-fault",
            code=diagnose(tilted="abs(rise) > 0.8", turned="abs(best) > 1.2", backwards="overlay_error(a, b, T) > 0.6"),
        ),
        mistake(
            "always sound",
            task="find-fault",
            loses=3,
            says="the answer is always",
            code='def find_fault(frames):\n    return "none"',
        ),
        mistake(
            "too tight",
            task="find-fault",
            loses=3,
            says="is the limit too tight",
            code=diagnose(turned="abs(best) >= 0"),
        ),
        mistake(
            "no gaps", task="find-fault", loses=3, says="the fault is 'two frames lost'", code=diagnose(lost="False")
        ),
        mistake(
            "no tilt", task="find-fault", loses=3, says="the fault is 'LIDAR tilted'", code=diagnose(tilted="False")
        ),
        mistake(
            "backwards isn't tried",
            task="find-fault",
            loses=3,
            says="the fault is 'poses backwards'",
            code=diagnose(backwards="False"),
        ),
        mistake(
            "the camera isn't tried",
            task="find-fault",
            loses=3,
            says="the fault is 'camera turned'",
            code=diagnose(turned="False"),
        ),
        mistake(
            "by heart: the first frame's time",
            task="find-fault",
            loses=3,
            says="on inputs you haven't seen",
            code=diagnose(
                lost="frames[8].time - frames[0].time > 0.9", turned="abs(best) >= 1 or frames[0].time > 0.5"
            ),
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        *(
            mistake(
                f"a limit of {limit} medians",
                task="find-gaps",
                loses=2,
                says="on inputs you haven't seen",
                code=f"""
def find_gaps(times):
    steps = np.diff(times)
    return np.flatnonzero(steps > {limit} * np.median(steps)).tolist()""",
            )
            for limit in (1.25, 1.42, 1.9)
        ),
        right(
            "a deque",
            task="find-gaps",
            code="""
from collections import deque
from statistics import median

def find_gaps(times):
    steps = [b - a for a, b in zip(times, times[1:])]
    return deque(k for k, step in enumerate(steps) if step > 1.5 * median(steps))""",
        ),
        right(
            "the package's recipe, as the lecture tells it",
            task="ground",
            code="""
def ground(points):
    x, y, z = np.asarray(points, float).T
    A, use = np.column_stack([np.ones_like(x), x, y]), np.ones(len(x), bool)
    for _ in range(10):
        plane = np.linalg.lstsq(A[use], z[use], rcond=None)[0]
        error = np.abs(z - A @ plane)
        use = error < max(0.1, np.median(error))
    return -plane[0], np.degrees(np.arctan(plane[1]))""",
        ),
        mistake(
            "10 cm off, thrown out once",
            task="ground",
            loses=1,
            says="on inputs you haven't seen: a car",
            code="""
def ground(points):
    x, y, z = np.asarray(points, float).T
    A, use = np.column_stack([np.ones_like(x), x, y]), np.ones(len(x), bool)
    for _ in range(2):
        plane = np.linalg.lstsq(A[use], z[use], rcond=None)[0]
        error = np.abs(z - A @ plane)
        use = error < 0.1
    return -plane[0], np.degrees(np.arctan(plane[1]))""",
        ),
        mistake(
            "by the order of the calls",
            task="find-fault",
            loses=3,
            says="on inputs you haven't seen",
            code="""
_orders = {5: ["none", "two frames lost", "camera turned", "LIDAR tilted", "poses backwards"]}
_calls = []

def find_fault(frames):
    _calls.append(1)
    order = ["none", "two frames lost", "LIDAR tilted"] if frames[0].time > 0.45 else _orders[5]
    return order[(len(_calls) - 1) % len(order)]""",
        ),
        mistake(
            "always the first two faults",
            task="find-fault",
            loses=3,
            says="on inputs you haven't seen",
            code=diagnose(turned="abs(best) >= 1 and frames[0].time < 0.45"),
        ),
    )
