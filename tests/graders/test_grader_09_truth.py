"""The graders of exercise 09, where truth comes from, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right


def depth(
    start="np.full(size, np.nan)",
    skip="Z <= 0",
    ray="(X / Z, Y / Z, 1)",
    inside="0 <= u <= size[1] - 1 and 0 <= v <= size[0] - 1",
    pixel="round(float(v)), round(float(u))",
    keep="np.fmin(depth[pixel], Z)",
    result="depth",
    before="",
):
    """Return an answer to task 1 with these parts."""
    return f"""
def depth_picture(points, K, size):
    depth = {start}
    for X, Y, Z in points:
        if {skip}:
            continue
        u, v, _ = K @ {ray}
        {before}
        if {inside}:
            pixel = {pixel}
            depth[pixel] = {keep}
    return {result}"""


def votes(
    kept="label != 255 and label != SKY",
    ground="[ROAD, SIDEWALK, VEGETATION]",
    best="np.where(standing.any(axis=1), standing.argmax(axis=1), votes.argmax(axis=1))",
    result="np.where(votes.any(axis=1), best, 255)",
    add="votes[cell, label] += 1",
    size="10",
):
    """Return an answer to task 2 with these parts."""
    return f"""
def count_votes(cells, classes, n_cells):
    votes = np.zeros((n_cells, {size}), int)
    for cell, label in zip(cells, classes):
        if {kept}:
            {add}
    standing = votes.copy()
    standing[:, {ground}] = 0
    best = {best}
    return {result}"""


def closing(body, pad="2 * reach", cut="[2 * reach : -2 * reach, 2 * reach : -2 * reach]"):
    """Return an answer to task 3 that does this to the padded mask."""
    return f"""
def close_mask(mask, reach):
    square = np.ones((2 * reach + 1, 2 * reach + 1), bool)
    padded = np.pad(mask, {pad})
    return ({body}){cut}"""


def unknown(
    state="o.argmax(axis=0)", near="(near != 255) & (state != UNKNOWN)", number="10 + state", votes="votes != 255"
):
    """Return an answer to task 4 with these parts."""
    return f"""
def fill_unknown(votes, o, near):
    state = {state}
    filled = np.where({near}, near, {number})
    return np.where({votes}, votes, filled)"""


def carry(
    known="np.isfinite(velocity).all(axis=1)",
    who="moves & known",
    way="velocity[moves & known] * seconds",
    kept="carried[~moves | known]",
    result="carried @ T_now_from_then[:3, :3].T + T_now_from_then[:3, 3]",
    start="points.copy()",
    sign="+=",
):
    """Return an answer to task 5 with these parts."""
    return f"""
def carry_window(points, moves, velocity, seconds, T_now_from_then):
    known = {known}
    carried = {start}
    carried[{who}, :2] {sign} {way}
    carried = {kept}
    return {result}"""


class TestTruth(GraderChecks):
    exercise = "09_truth"
    entries = (
        # ---- task 1
        right(
            "the farthest first, so that closer ones overwrite",
            task="depth-picture",
            code="""
def depth_picture(points, K, size):
    picture = np.full(size, np.nan)
    points = points[points[:, 2] > 0]
    points = points[np.argsort(-points[:, 2])]
    u, v = (K[:2, :2] @ points[:, :2].T) / points[:, 2] + K[:2, 2:]
    seen = (u >= 0) & (u <= size[1] - 1) & (v >= 0) & (v <= size[0] - 1)
    for row, col, Z in zip(np.rint(v[seen]).astype(int), np.rint(u[seen]).astype(int), points[seen, 2]):
        picture[row, col] = Z
    return picture""",
        ),
        right(
            "np.minimum.at",
            task="depth-picture",
            code="""
def depth_picture(points, K, size):
    ahead = points[points[:, 2] > 0]
    pixels = ahead @ K.T
    u, v = pixels[:, 0] / ahead[:, 2], pixels[:, 1] / ahead[:, 2]
    seen = (0 <= u) & (u <= size[1] - 1) & (0 <= v) & (v <= size[0] - 1)
    picture = np.full(size, np.inf)
    np.minimum.at(picture, (np.rint(v[seen]).astype(int), np.rint(u[seen]).astype(int)), ahead[seen, 2])
    picture[np.isinf(picture)] = np.nan
    return picture""",
        ),
        mistake(
            "the last one wins",
            task="depth-picture",
            loses=2,
            says="that is the last return in the list",
            code=depth(keep="Z"),
        ),
        mistake(
            "the farthest",
            task="depth-picture",
            loses=2,
            says="or the farthest: of several the closest counts",
            code=depth(keep="np.fmax(depth[pixel], Z)"),
        ),
        mistake(
            "the first one wins",
            task="depth-picture",
            loses=2,
            says="that is the first return in the list",
            code=depth(keep="Z if np.isnan(depth[pixel]) else depth[pixel]"),
        ),
        mistake(
            "the distance in place of the depth",
            task="depth-picture",
            loses=2,
            says="holds the distance of the return",
            code=depth(keep="np.fmin(depth[pixel], np.sqrt(X * X + Y * Y + Z * Z))"),
        ),
        mistake(
            "behind the camera", task="depth-picture", loses=2, says="look at the sign of Z", code=depth(skip="Z == 0")
        ),
        mistake(
            "cut off instead of rounded",
            task="depth-picture",
            loses=2,
            says="round to the nearest pixel, don't cut off",
            code=depth(pixel="int(v), int(u)"),
        ),
        mistake(
            "rounded before the test",
            task="depth-picture",
            loses=2,
            says="test the pixel against the image before you round it",
            code=depth(before="u, v = round(float(u)), round(float(v))"),
        ),
        mistake(
            "rows and columns swapped",
            task="depth-picture",
            loses=2,
            says="the picture is turned",
            code=depth(start="np.full(size[::-1], np.nan)", pixel="round(float(u)), round(float(v))"),
        ),
        mistake(
            "infinite where nothing is",
            task="depth-picture",
            loses=2,
            says="a pixel without a return is np.nan, not infinite",
            code=depth(start="np.full(size, np.inf)"),
        ),
        mistake(
            "zero where nothing is",
            task="depth-picture",
            loses=2,
            says="a pixel without a return is np.nan",
            code=depth(result="np.nan_to_num(depth)"),
        ),
        mistake(
            "one focal length for both",
            task="depth-picture",
            loses=2,
            says="on inputs you haven't seen: other pixels have a depth, with other focal lengths",
            code=depth(before="v = K[0, 0] * Y / Z + K[1, 2]"),
        ),
        # ---- task 2
        right(
            "a loop over cells",
            task="count-votes",
            code="""
def count_votes(cells, classes, n_cells):
    made = np.full(n_cells, 255)
    for cell in range(n_cells):
        mine = [c for c in classes[cells == cell] if c not in (255, SKY)]
        stands = [c for c in mine if c not in (ROAD, SIDEWALK, VEGETATION)]
        voters = stands or mine
        if voters:
            made[cell] = max(sorted(set(voters)), key=voters.count)
    return made""",
        ),
        right(
            "ground last by a large bonus",
            task="count-votes",
            code="""
def count_votes(cells, classes, n_cells):
    votes = np.zeros((n_cells, 256))
    np.add.at(votes, (cells, classes), 1)
    votes[:, [SKY, 255]] = 0
    bonus = np.full(256, 1e6)
    bonus[[ROAD, SIDEWALK, VEGETATION]] = 0
    score = np.where(votes > 0, votes + bonus, 0)
    return np.where(score.any(axis=1), score.argmax(axis=1), 255)""",
        ),
        mistake(
            "majority",
            task="count-votes",
            loses=2,
            says="What stands wins, be it one vote",
            code=votes(best="votes.argmax(axis=1)"),
        ),
        mistake("sky votes", task="count-votes", loses=2, says="cell 2 became sky", code=votes(kept="label != 255")),
        mistake(
            "a cell without a vote is road",
            task="count-votes",
            loses=2,
            says="a cell without a vote is 255",
            code=votes(result="best"),
        ),
        mistake(
            "255 votes",
            task="count-votes",
            loses=2,
            says="255 isn't a class that wins votes",
            code=votes(kept="label != SKY", size="256"),
        ),
        mistake(
            "vegetation stands",
            task="count-votes",
            loses=2,
            says="vegetation counts as standing",
            code=votes(ground="[ROAD, SIDEWALK]"),
        ),
        mistake(
            "the largest number wins",
            task="count-votes",
            loses=2,
            says="not the one with the largest number",
            code="""
def count_votes(cells, classes, n_cells):
    made = np.full(n_cells, 255)
    for cell in range(n_cells):
        mine = classes[(cells == cell) & (classes != 255) & (classes != SKY)]
        stands = mine[~np.isin(mine, [ROAD, SIDEWALK, VEGETATION])]
        voters = stands if len(stands) else mine
        if len(voters):
            made[cell] = voters.max()
    return made""",
        ),
        mistake(
            "ties to the last class",
            task="count-votes",
            loses=2,
            says="of equally frequent classes the one with the smallest number wins",
            code=votes(
                best="np.where(standing.any(axis=1), 9 - standing[:, ::-1].argmax(axis=1), votes.argmax(axis=1))"
            ),
        ),
        mistake(
            "a vote counted once, however often",
            task="count-votes",
            loses=2,
            says="cell 1: sidewalk has two votes, road one",
            code=votes(add="votes[cell, label] = 1"),
        ),
        mistake(
            "a single class that stands, by name",
            task="count-votes",
            loses=2,
            says="on inputs you haven't seen: another class wins in a cell with several",
            code=votes(ground="[ROAD, SIDEWALK, VEGETATION, 8]"),
        ),
        # ---- task 3
        right(
            "shifted copies",
            task="close-mask",
            code="""
def close_mask(mask, reach):
    height, width = mask.shape
    padded = np.pad(mask.astype(bool), 2 * reach)
    steps = [(i, j) for i in range(2 * reach + 1) for j in range(2 * reach + 1)]
    dilated = np.zeros((height + 2 * reach, width + 2 * reach), bool)
    for i, j in steps:
        dilated |= padded[i : i + height + 2 * reach, j : j + width + 2 * reach]
    closed = np.ones((height, width), bool)
    for i, j in steps:
        closed &= dilated[i : i + height, j : j + width]
    return closed""",
        ),
        right(
            "growing what is there, then what is not",
            task="close-mask",
            code="""
def close_mask(mask, reach):
    def grow(m):
        rows, cols = np.nonzero(m)
        out = np.zeros_like(m)
        for r, c in zip(rows, cols):
            out[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1] = True
        return out
    wide = np.pad(mask.astype(bool), 2 * reach)
    closed = ~grow(~grow(wide))
    return closed[2 * reach : -2 * reach, 2 * reach : -2 * reach]""",
        ),
        mistake(
            "opened instead of closed",
            task="close-mask",
            loses=2,
            says="Dilate first, then erode",
            code=closing("ndimage.binary_dilation(ndimage.binary_erosion(padded, square), square)"),
        ),
        mistake(
            "dilated alone",
            task="close-mask",
            loses=2,
            says="that is the dilated mask",
            code=closing("ndimage.binary_dilation(padded, square)"),
        ),
        mistake(
            "nothing around the map",
            task="close-mask",
            loses=2,
            says="surround the map with False cells before you dilate",
            code=closing("ndimage.binary_closing(padded, square)", pad="0", cut=""),
        ),
        mistake(
            "not cut off",
            task="close-mask",
            loses=2,
            says="cut the surrounding cells off",
            code=closing("ndimage.binary_closing(padded, square)", cut=""),
        ),
        mistake(
            "a cross, scipy's default",
            task="close-mask",
            loses=2,
            says="the gap of two cells is still open",
            code=closing("ndimage.binary_closing(padded, iterations=reach)"),
        ),
        mistake(
            "twice the reach",
            task="close-mask",
            loses=2,
            says="the gap of five cells is closed",
            code=closing("ndimage.binary_closing(padded, square, iterations=3)", pad="6", cut="[6:-6, 6:-6]"),
        ),
        mistake(
            "rows alone",
            task="close-mask",
            loses=2,
            says="turned upright",
            code=closing("ndimage.binary_closing(padded, square[:1])"),
        ),
        mistake(
            "columns are joined, too far in the corners",
            task="close-mask",
            loses=2,
            says="on inputs you haven't seen",
            code=closing("ndimage.binary_closing(padded, square[:1]) | ndimage.binary_closing(padded, square[:, :1])"),
        ),
        # ---- task 4
        right(
            "a loop",
            task="fill-unknown",
            code="""
def fill_unknown(votes, o, near):
    filled = votes.copy()
    for r in range(votes.shape[0]):
        for c in range(votes.shape[1]):
            if votes[r, c] == 255:
                state = int(np.argmax(o[:, r, c]))
                filled[r, c] = near[r, c] if near[r, c] != 255 and state != UNKNOWN else 10 + state
    return filled""",
        ),
        right(
            "a table of the unknown classes",
            task="fill-unknown",
            code="""
def fill_unknown(votes, o, near):
    state = np.argmax(o, axis=0)
    filled = np.array([10, 11, 12, 13])[state]
    spread = (state != UNKNOWN) & (near < 255)
    filled[spread] = near[spread]
    labelled = votes < 255
    filled[labelled] = votes[labelled]
    return filled""",
        ),
        right(
            "nested lists, and helpers with everyday names",
            task="fill-unknown",
            code="""
weights, read, gradient, field, before, mask, points = "these were names of the test cells".split()


def got(vote, states, around):
    state = int(np.argmax(states))
    return int(vote if vote != 255 else around if around != 255 and state != UNKNOWN else 10 + state)


def fill_unknown(votes, o, near):
    return [[got(votes[r, c], o[:, r, c], near[r, c]) for c in range(votes.shape[1])] for r in range(len(votes))]""",
        ),
        mistake(
            "names of classes",
            task="fill-unknown",
            loses=2,
            says="fill_unknown returned no array of numbers but a list",
            code="def fill_unknown(votes, o, near):\n    return [['road'] * 4, ['car'] * 4]",
        ),
        mistake(
            "what nobody observed is filled",
            task="fill-unknown",
            loses=2,
            says="the filter has not observed it",
            code=unknown(near="near != 255"),
        ),
        mistake(
            "nothing is filled",
            task="fill-unknown",
            loses=2,
            says="it takes that",
            code=unknown(near="(near != 255) & False"),
        ),
        mistake(
            "255 stays", task="fill-unknown", loses=2, says="cells are still 255", code=unknown(near="state != UNKNOWN")
        ),
        mistake(
            "the filter overrules votes",
            task="fill-unknown",
            loses=2,
            says="a vote stays, whatever the filter says",
            code=unknown(votes="(votes != 255) & (state != UNKNOWN)"),
        ),
        mistake(
            "the number of the state",
            task="fill-unknown",
            loses=2,
            says="the unknown classes begin at 10",
            code=unknown(number="state"),
        ),
        mistake(
            "counted from UNKNOWN",
            task="fill-unknown",
            loses=2,
            says="FREE and UNKNOWN are swapped",
            code=unknown(number="13 - state"),
        ),
        mistake(
            "the maximum over rows",
            task="fill-unknown",
            loses=2,
            says="a maximum over axis 0",
            code="""
def fill_unknown(votes, o, near):
    return 10 + o.argmax(axis=1)""",
        ),
        mistake(
            "dynamic counts as static",
            task="fill-unknown",
            loses=2,
            says="rather DYNAMIC (0.6) than STATIC",
            code=unknown(number="10 + np.array([0, 1, 1, 3])[state]"),
        ),
        mistake(
            "only what is free is filled",
            task="fill-unknown",
            loses=2,
            says="on inputs you haven't seen: a cell with vote 255 and state",
            code=unknown(near="(near != 255) & (state == FREE)"),
        ),
        # ---- task 5
        right(
            "point by point",
            task="carry-window",
            code="""
def carry_window(points, moves, velocity, seconds, T_now_from_then):
    rows = []
    for p, m, v in zip(points, moves, velocity):
        p = np.append(p, 1.0)
        if m:
            if np.isnan(v).any():
                continue
            p[:2] += v * seconds
        rows.append((T_now_from_then @ p)[:3])
    return np.array(rows).reshape(-1, 3)""",
        ),
        right(
            "homogeneous coordinates, velocities without NaN",
            task="carry-window",
            code="""
def carry_window(points, moves, velocity, seconds, T_now_from_then):
    gone = moves & np.isnan(velocity).any(axis=1)
    step = np.where(moves[:, None], velocity, 0.0) * seconds
    moved = np.column_stack([points[:, :2] + step, points[:, 2], np.ones(len(points))])[~gone]
    return (moved @ T_now_from_then.T)[:, :3]""",
        ),
        mistake(
            "not carried",
            task="carry-window",
            loses=3,
            says="the car was left where it was",
            code=carry(way="0 * velocity[moves & known]"),
        ),
        mistake("backward", task="carry-window", loses=3, says="the car went backward", code=carry(sign="-=")),
        mistake(
            "without time",
            task="carry-window",
            loses=3,
            says="that is its velocity",
            code=carry(way="velocity[moves & known]"),
        ),
        mistake(
            "carried after the transform",
            task="carry-window",
            loses=3,
            says="you added the motion after the transform",
            code=carry(start="points @ T_now_from_then[:3, :3].T + T_now_from_then[:3, 3]", result="carried"),
        ),
        mistake(
            "not transformed",
            task="carry-window",
            loses=3,
            says="nothing was transformed",
            code=carry(result="carried"),
        ),
        mistake(
            "the inverse transform",
            task="carry-window",
            loses=3,
            says="you used the inverse transform",
            code=carry(result="(carried - T_now_from_then[:3, 3]) @ T_now_from_then[:3, :3]"),
        ),
        mistake(
            "turned, not shifted",
            task="carry-window",
            loses=3,
            says="its 4 m are missing",
            code=carry(result="carried @ T_now_from_then[:3, :3].T"),
        ),
        mistake(
            "what stands is carried too",
            task="carry-window",
            loses=3,
            says="only what `moves` is",
            code=carry(who="known", way="velocity[known] * seconds"),
        ),
        mistake(
            "unknown velocities kept",
            task="carry-window",
            loses=3,
            says="what moves with an unknown velocity is left out",
            code=carry(kept="carried"),
        ),
        mistake(
            "one known part is enough",
            task="carry-window",
            loses=3,
            says="a return has NaN",
            code=carry(known="np.isfinite(velocity).any(axis=1)"),
        ),
        mistake(
            "what stands needs a velocity",
            task="carry-window",
            loses=3,
            says="3 returns came back",
            code=carry(kept="carried[known]"),
        ),
        mistake(
            "moving ones alone",
            task="carry-window",
            loses=3,
            says="these are the moving ones, or the standing ones, alone",
            code=carry(kept="carried[moves & known]"),
        ),
        mistake(
            "carved",
            task="carry-window",
            loses=3,
            says="these are the moving ones, or the standing ones, alone",
            code=carry(kept="carried[~moves]"),
        ),
        mistake(
            "its own argument",
            task="carry-window",
            loses=3,
            says="changed its argument `points`",
            code=carry(start="points"),
        ),
        mistake(
            "only in the plane",
            task="carry-window",
            loses=3,
            says="on inputs you haven't seen: an earlier scan",
            code=carry(
                result="np.column_stack([carried[:, :2] @ T_now_from_then[:2, :2].T + T_now_from_then[:2, 3], "
                "carried[:, 2]])"
            ),
        ),
        mistake(
            "a loop without an end",
            task="carry-window",
            loses=3,
            says="before timeout",
            code="""
def carry_window(points, moves, velocity, seconds, T_now_from_then):
    while seconds > 0:
        points = points + 0
    return points""",
        ),
        # ---- passed, or lost, when somebody tried who had not written the tests
        mistake(
            "nothing nearer than three metres",
            task="depth-picture",
            loses=2,
            says="on inputs you haven't seen",
            code=depth(skip="Z < 3"),
        ),
        mistake(
            "nothing beyond 31 m",
            task="depth-picture",
            loses=2,
            says="on inputs you haven't seen: a return is missing or wrong",
            code=depth(skip="Z <= 0 or Z > 31"),
        ),
        mistake(
            "borders left out",
            task="depth-picture",
            loses=2,
            says="on inputs you haven't seen: a return is missing or wrong",
            code=depth(inside="0 < u < size[1] - 1 and 0 < v < size[0] - 1"),
        ),
        mistake(
            "a skew ignored",
            task="depth-picture",
            loses=2,
            says="on inputs you haven't seen: other pixels have a depth",
            code=depth(before="K = np.array([[K[0, 0], 0, K[0, 2]], [0, K[1, 1], K[1, 2]], [0, 0, 1]])"),
        ),
        right(
            "halves rounded up",
            task="depth-picture",
            code=depth(pixel="int(np.floor(v + 0.5)), int(np.floor(u + 0.5))"),
        ),
        right(
            "a deque of rows",
            task="count-votes",
            code="""
from collections import deque

def count_votes(cells, classes, n_cells):
    ground, found = (ROAD, SIDEWALK, VEGETATION), deque()
    for cell in range(n_cells):
        votes = [c for c in classes[cells == cell].tolist() if c not in (255, SKY)]
        votes = [c for c in votes if c not in ground] or votes
        found.append(max(sorted(set(votes)), key=votes.count) if votes else 255)
    return found""",
        ),
    )
