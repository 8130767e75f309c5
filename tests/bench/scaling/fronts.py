"""The tree of fronts above the ranks' own subtrees, as three numbers, and what it costs p ranks: the model's part for the factorisation.

A level l of the tree has 2^l fronts alike. Each belongs to p / 2^l ranks, as proportional mapping deals them (precompute/ldlt/mapping.hpp),
in tiles in two dimensions (tile_map.hpp). Two counts say how large the fronts are: operations and entries of all shared fronts. Everything
else is predicted from there, for the fullest rank.
"""
import dataclasses
import math

TILE = 72  # unknowns of a tile: 24 nodes
COLUMNS = 16  # of a solve
SMALL = 0.06  # of a rank: subtrees that lie on two ranks and are smaller go to one of them whole
FULLEST = 1.25  # entries of the fullest rank over the mean: the mapping's bound
PATH = 1.25  # operations on the path over total / ranks, on very many ranks ...
PATH_STEP = 0.5  # ... of whose excess 1 - 2^(-0.5 levels) is reached: fitted to the counts
GANG = 2.4  # the same where the ranks of a front wait for one another, on very many ranks ...
GANG_STEP = 0.35  # ... of whose excess (1 - 2^(-0.35 levels))^2 is reached: fitted to the counts
UNEVEN = 1.25  # messages and bytes of the fullest rank of a front over the mean: fitted to the counts, as those below
MORE_SUMS = 1.27  # messages and bytes of a solve that the fullest rank of a front receives over the mean
LONGEST = 1.6  # panels on the longest way to the root over those of mean fronts
MEETINGS = 1.5  # fronts of a level that the fullest rank shares where each has at most one rank's work: subtrees are levelled
SPREAD = 1.3  # tiles of the fullest rank of a front over the mean


def count_flops(pivots, order):
    return pivots * order**2 - pivots**2 * order + pivots**3 / 3


def count_entries(pivots, order):
    return pivots * order - pivots**2 / 2


@dataclasses.dataclass(frozen=True)
class Level:
    """One of the 2^l fronts of a level: unknowns, and the ranks that it has by its share of the work."""

    number: int
    pivots: float
    order: float
    ranks: float  # below 1: a part of a rank

    @property
    def rows(self):
        return self.order - self.pivots

    @property
    def group(self):
        """Ranks that an interval of this length meets: at its ends it has parts of ranks."""
        return 2.0 if self.ranks <= 1 else self.ranks if self.number == 0 else self.ranks + 1

    @property
    def shared(self):
        """Which part of the fronts of the level lies on more than one rank."""
        return min(1.0, self.ranks)

    @property
    def child_group(self):
        return self.ranks / 2 + 1 if self.ranks > 2 else 1.5

    @property
    def grid(self):
        """(ranks of a column of tiles, classes of columns)"""
        rows = 1 if self.group < 4 else math.floor(math.sqrt(self.group))
        return rows, self.group / rows

    @property
    def panels(self):
        return math.ceil(self.pivots / TILE)


@dataclasses.dataclass(frozen=True)
class Tree:
    root: float  # unknowns of the root, all pivots
    shrink: float  # pivots of a front over those of its parent
    border: float  # order of a front below the root over its pivots

    def list_levels(self, ranks):
        """Those that have shared fronts, root first."""
        levels = []
        while ranks > 1 and ranks / 2 ** len(levels) >= SMALL:
            number = len(levels)
            pivots = self.root * self.shrink**number
            levels.append(Level(number, pivots, pivots * (self.border if number else 1.0), ranks / 2**number))
        return levels

    def grow(self, ratio):
        """With that many times the unknowns: separators grow as areas."""
        return dataclasses.replace(self, root=self.root * ratio ** (2 / 3))


def count_shared(tree, ranks):
    """(operations, entries) of all shared fronts."""
    levels = tree.list_levels(ranks)
    return tuple(
        sum(one.shared * 2**one.number * count(one.pivots, one.order) for one in levels) for count in (count_flops, count_entries)
    )


def fit_tree(rows):
    """The tree whose shared fronts have the operations and entries counted: rows of (ranks, operations, entries). Least squares in
    logarithms."""

    def find_error(tree):
        pairs = [(count_shared(tree, ranks), (operations, entries)) for ranks, operations, entries in rows]
        return sum(math.log(model / counted) ** 2 for one in pairs for model, counted in zip(*one))

    # Corners of a simplex in the logarithms of root, 1 - shrink and border - 1 (Nelder and Mead 1965).
    make = lambda point: Tree(math.exp(point[0]), 1 - math.exp(min(point[1], -0.05)), 1 + math.exp(point[2]))
    along = lambda a, b, share: tuple(x + share * (y - x) for x, y in zip(a, b))
    begin = (0.5 * math.log(2 * rows[0][2]), math.log(0.3), math.log(1.5))
    corners = [begin] + [tuple(value + 0.3 * (i == axis) for i, value in enumerate(begin)) for axis in range(3)]
    corners = [(find_error(make(point)), point) for point in corners]
    for _ in range(400):
        corners.sort()
        if max(abs(x - y) for x, y in zip(corners[0][1], corners[3][1])) < 1e-6:
            break
        middle = tuple(sum(point[i] for _, point in corners[:3]) / 3 for i in range(3))
        judge = lambda share: (lambda point: (find_error(make(point)), point))(along(middle, corners[3][1], share))
        mirrored = judge(-1)
        if mirrored < corners[0]:
            corners[3] = min(mirrored, judge(-2))
        elif mirrored < corners[2]:
            corners[3] = mirrored
        elif (inner := judge(0.5)) < corners[3]:
            corners[3] = inner
        else:
            corners[1:] = [(find_error(make(near)), near) for near in (along(corners[0][1], point, 0.5) for _, point in corners[1:])]
    return make(min(corners)[1])


def find_meetings(level, ranks):
    """Fronts of a level in which the fullest rank has a share: an end of an interval lies inside most ranks."""
    return min(MEETINGS if level.ranks <= 1 else 1 + 1 / level.ranks, ranks - 1.0)


def count_factor_messages(tree, ranks):
    """(messages, bytes) that the fullest rank receives in a factorisation: panels from the ranks that have its rows and its columns, and
    what the children leave."""
    messages = size = 0.0
    for one in tree.list_levels(ranks):
        rows, classes = one.grid
        entries = count_entries(one.pivots, one.order)
        if rows == 1:
            panels, panel_bytes = one.panels * (1 - 1 / one.group), 8 * entries * (1 - 1 / one.group)
        else:
            panels, panel_bytes = one.panels * rows, 8 * entries * (1 / rows + 1 / classes)
        child_rows = one.pivots * tree.shrink * (tree.border - 1)
        met = find_meetings(one, ranks)
        messages += met * (panels + 2 * one.child_group)
        size += met * (panel_bytes + 2 * 8 * child_rows**2 / 2 / one.group * (1 - 1 / one.group))
    return UNEVEN * messages, UNEVEN * size


def count_solve_messages(tree, ranks):
    """(messages, bytes) that the fullest rank receives in a solve of COLUMNS columns, there and back."""
    messages = size = 0.0
    for one in tree.list_levels(ranks):
        rows, classes = one.grid
        met = find_meetings(one, ranks)
        inside = 2 * one.panels * ((rows - 1) + (classes - 1)) / one.group * met
        child_rows = one.pivots * tree.shrink * (tree.border - 1)
        between = met * (2 * one.child_group + one.group)
        sums = 4 * child_rows * math.sqrt(one.child_group) / one.group * (1 - 1 / one.group)
        messages += MORE_SUMS * (inside + between)
        size += MORE_SUMS * 8 * COLUMNS * (inside * TILE + met * sums)
    return messages, size


def count_solve_path(tree, ranks):
    """Messages one after the other in a solve: to a front and back, and at each panel along its row and its column, there and back."""
    return LONGEST * sum(2 + 4 * one.panels for one in tree.list_levels(ranks))


def count_peak_bytes(tree, ranks, entries):
    """Of the fullest rank, without the program: its part of L, its tiles of the largest front and as many numbers that the children send,
    and what its own subtrees have left for shared fronts. A bound: pivot columns lie in the place of L."""
    levels = tree.list_levels(ranks)
    tiles = max((one.order**2 / 2 / max(one.ranks, 1.0) for one in levels), default=tree.root**2 / 2)
    left = sum(one.rows**2 / 2 for one in levels if one.ranks < 1)
    return 8 * ((FULLEST if ranks > 1 else 1.0) * entries / ranks + 2 * SPREAD * tiles + left)


def find_path(ranks):
    return 1 + (PATH - 1) * (1 - 2 ** (-PATH_STEP * math.log2(ranks)))


def find_gang(ranks):
    return max(find_path(ranks), 1 + (GANG - 1) * (1 - 2 ** (-GANG_STEP * math.log2(ranks))) ** 2)
