"""Bounded Gauss-Newton steps of a body's parameters towards wished frequencies, with modes followed by their shapes.

Method: least squares of the derivatives by cuts, within bounds and a largest step (scipy's lsq_linear: Branch, Coleman and Li 1999); a step
is halved until the residual falls. Modes are followed by the modal assurance criterion, so crossings do not exchange them.
"""
import dataclasses

import numpy
import scipy.optimize

import shapes
import solver
import targets

FAR_CENTS = 400.0  # of the largest residual that a step is to take away: first order is not valid further
COARSE_CENTS = 3.0  # left on the coarse mesh
MIN_SHAPE = 0.6  # MAC of a followed mode
MAX_STEPS, MIN_SHARE = 14, 0.1
SLOW, MEMORY = 0.95, 2  # a search ends when twice so many steps leave more than this of the residual
FINE = 2.0  # elements of the fine mesh along an edge, of the coarse
MODES, SPARE_MODES = 24, 6  # of the first solve; above the highest wish: those that may come down
SMOOTH, DAMPING = 0.02, 0.01  # weights of jumps and of the step, of the largest derivative
WIDEST_PAIR, MAX_CLOSING, DEAR = 60.0, 6, 1e3  # cents of a beat; steps; price of a cent that is left, of all the volume
CLEAR = 1.2  # a mode that must stay away is sent so much further,
NEAR_APART = 1.5  # and stands against a wish within so much


@dataclasses.dataclass
class State:
    """A design: p (K), its Solution and the modes of each wish. off_cents (wishes): corrected minus wished."""

    p: numpy.ndarray
    solution: solver.Solution
    groups: list
    off_cents: numpy.ndarray
    bank: object = None  # path
    jacobian: object = None  # (wishes, K) by shapes.calc_jacobian(), when it was asked for
    mac: float = 1.0  # least, of the modes it was followed from

    @property
    def bars(self):
        return numpy.array([max(self.solution.bar_cents[m] for m in group) for group in self.groups])

    @property
    def hz(self):
        return numpy.array([numpy.exp2(numpy.mean(numpy.log2(self.solution.corrected_hz[group]))) for group in self.groups])


@dataclasses.dataclass
class Pairs(State):
    """A design whose wishes are pairs without a beat; off_cents are the splits of the mesh, whose error both modes of a pair share."""

    def __init__(self, p, solution, groups, bank):
        super().__init__(p, solution, groups, numpy.zeros(0), bank)
        hz = solution.freq_hz[numpy.array(groups)]
        self.splits = 1200 * numpy.log2(hz[:, 1] / hz[:, 0])
        self.off_cents = numpy.abs(self.splits)


@dataclasses.dataclass
class Outcome:
    """reached: all wishes are met. obstacle: the mode and bound in the way, else empty."""

    first: State
    last: State
    body: object
    jacobian: numpy.ndarray  # (wishes, K) cents per unit of p
    reached: bool
    obstacle: str
    steps: list  # [(mesh, off_cents, largest p)] for a report


def follow(state, solution):
    """(groups in another solution, least MAC): both modes of a pair count as one space."""
    flat = [m for group in state.groups for m in group]
    before = dataclasses.replace(state.solution, shapes=state.solution.shapes[flat])
    mac = solver.compare(before, solution)
    chosen = scipy.optimize.linear_sum_assignment(-mac)[1]
    groups, least, at = [], 1.0, 0
    for group in state.groups:
        rows = range(at, at + len(group))
        modes = sorted(int(chosen[row]) for row in rows)
        least = min([least, *(mac[row][modes].sum() for row in rows)])
        groups.append(modes)
        at += len(group)
    return groups, least


class Search:
    """solve(job, sensitivities) of the solver; limits of a search: cents to be left."""

    def __init__(self, run, wishes, aparts, cents, folder, say):
        self.run, self.wishes, self.aparts, self.cents, self.folder, self.say = run, wishes, aparts, cents, folder, say
        self.modes = MODES
        self.steps = []
        self.missed = None  # of find_jacobian()
        self.set_wishes(wishes)

    def set_wishes(self, wishes):
        self.wishes, self.weights = wishes, numpy.array([wish.weight for wish in wishes])

    def solve(self, body, p):
        """(Solution, path of its bank)."""
        job = body.make_job(p, self.folder) | {"max_modes": self.modes}
        bank = self.folder / f"bank-{self.run.solves}.hdf"
        return self.run.solve(job, self.modes, bank), bank

    def make_state(self, p, solution, groups, bank):
        state = State(p, solution, groups, numpy.zeros(0), bank)
        state.off_cents = 1200 * numpy.log2(state.hz / [wish.hz for wish in self.wishes])
        return state

    def start(self, body, p):
        """The State of the first design; more modes until every wish has one."""
        while True:
            solution, bank = self.solve(body, p)
            try:
                state = self.make_state(p, solution, targets.find_groups(solution, self.wishes), bank)
            except targets.InputError:
                if self.modes >= 96 or len(solution.corrected_hz) < self.modes:
                    raise
                self.modes *= 2
                continue
            highest = max(m for group in state.groups for m in group)
            self.modes = min(self.modes, highest + 1 + SPARE_MODES)
            self.check_aparts(solution)
            return state

    def find_apart(self, body, state):
        """Rows (derivative, residual) for modes that are too close to a wish, each with its distance in cents."""
        rows, residual, gaps = [], [], []
        for apart in self.aparts:
            for group in targets.find_kind(state.solution, apart.kind):
                for wished in state.groups:
                    gap = 1200 * numpy.log2(state.solution.corrected_hz[group[0]] / state.solution.corrected_hz[wished[0]])
                    if set(group) & set(wished) or abs(gap) >= apart.cents:
                        continue
                    both = shapes.calc_jacobian(body, state, [group, wished])
                    rows.append(both[0] - both[1])
                    residual.append((1 if gap > 0 else -1) * CLEAR * apart.cents - gap)
                    gaps.append(apart.cents - abs(gap))
        return rows, residual, gaps

    def measure(self, body, state):
        """What a step must reduce."""
        _, residual, _ = self.find_apart(body, state)
        return float(numpy.sum((self.weights * state.off_cents) ** 2) + numpy.sum(numpy.square(residual)))

    def find_jacobian(self, body, state):
        """(wishes, K). Of a body that is meshed again, with what its derivatives missed in all steps so far (secants: Broyden 1965): its
        parameters change all modes by nearly the same ratio, so an error of a few percent hides what they change of the intervals."""
        if state.jacobian is None:
            state.jacobian = shapes.calc_jacobian(body, state, state.groups)
        return state.jacobian if self.missed is None else state.jacobian + self.missed

    def learn(self, jacobian, state, after):
        way = after.p - state.p
        missed = numpy.outer(after.off_cents - state.off_cents - jacobian @ way, way) / (way @ way)
        self.missed = missed if self.missed is None else self.missed + missed

    def find_step(self, body, state, jacobian):
        """The step (K)."""
        rows, residual, _ = self.find_apart(body, state)
        a = numpy.concatenate([self.weights[:, None] * jacobian, *([row] for row in rows)]) * body.step
        y = numpy.concatenate([-self.weights * state.off_cents, residual])
        near = 1.0 if numpy.abs(y).max() > 20 else 10.0
        scale = numpy.abs(a).max() / near
        extra = [DAMPING * scale * numpy.eye(len(state.p))]
        right = [numpy.zeros(len(state.p))]
        if body.smooth and len(state.p) > 2:
            bend = numpy.diff(numpy.eye(len(state.p)), 2, axis=0) * SMOOTH * scale
            extra.append(bend)
            right.append(numpy.zeros(len(bend)))
        low = numpy.maximum(body.low - state.p, -body.step) / body.step
        high = numpy.minimum(body.high - state.p, body.step) / body.step
        found = scipy.optimize.lsq_linear(
            numpy.concatenate([a, *extra]),
            numpy.concatenate([y * min(1.0, FAR_CENTS / numpy.abs(y).max()), *right]),
            (low - 1e-9, high + 1e-9),
        )
        return numpy.clip(found.x, low, high) * body.step

    def visit(self, body, p, state):
        """The State of another design with the modes of a State."""
        solution, bank = self.solve(body, p)
        groups, least = follow(state, solution)
        after = self.make_state(p, solution, groups, bank)
        after.mac = least
        return after

    def advance(self, body, state, limit):
        """The next State, or None where no part of the step comes below the limit."""
        share = 1.0
        while share >= MIN_SHARE:
            jacobian = self.find_jacobian(body, state)
            p = state.p + share * self.find_step(body, state, jacobian)
            if numpy.abs(p - state.p).max() < 1e-9:
                return None
            after = self.visit(body, p, state)
            if body.is_remeshed:
                self.learn(jacobian, state, after)
            if after.mac > MIN_SHAPE and self.measure(body, after) < limit:
                return after
            share /= 2
        return None

    def is_reached(self, body, state, cents):
        return bool(numpy.abs(state.off_cents).max() <= cents and not self.find_apart(body, state)[2])

    def descend(self, body, state, cents, name):
        """The best State of a mesh: within cents, or where no step helps."""
        best, left = state, [self.measure(body, state)]
        for _ in range(MAX_STEPS):
            self.note(name, body, state)
            if self.is_reached(body, state, cents):
                return state
            # Along curved valleys a step may lose a little before the next one gains (Grippo, Lampariello and Lucidi 1986).
            state = self.advance(body, state, max(left[-MEMORY:]))
            if state is None:
                return best
            left.append(self.measure(body, state))
            best = state if left[-1] <= min(left) else best
            if len(left) > 2 * MEMORY and min(left[-2 * MEMORY :]) > SLOW * min(left[: -2 * MEMORY]):
                return best
        return best

    def note(self, name, body, state):
        self.steps.append((name, state.off_cents.tolist(), state.p.tolist()))
        off = ", ".join(f"{cents:+.2f}" for cents in state.off_cents)
        self.say(f"solve {self.run.solves}, {name} mesh: {off} cents off")

    def tune(self, make_body, p):
        """Coarse mesh, then the fine one. make_body: fineness to body, the same where it has one mesh."""
        coarse, fine = make_body(1.0), make_body(FINE)
        enough = self.cents if fine is coarse else max(COARSE_CENTS, self.cents)
        try:
            first = self.start(coarse, p)
        except targets.InputError:  # on a coarse mesh a round body may not look round, and its modes have no kinds
            if fine is coarse:
                raise
            coarse, enough, self.modes = fine, self.cents, MODES
            first = self.start(fine, p)
        body = coarse.leave_doubtful(first.solution, p)
        state = self.descend(body, first, enough, "coarse")
        if fine is not coarse and self.is_reached(body, state, enough):
            state = self.visit(fine, state.p, state)
            body = fine.leave_doubtful(state.solution, state.p)
            state = self.descend(body, state, self.cents, "fine")
        reached = self.is_reached(body, state, self.cents)
        jacobian = self.find_jacobian(body, state)
        obstacle = "" if reached else self.find_obstacle(body, state, jacobian)
        return Outcome(first, state, body, jacobian, reached, obstacle, self.steps)

    def close(self, body, numbers, kept):
        """Closes the beats of pairs (numbers from 1) by cuts of least volume; kept: modes (from 1) whose frequency stays. Linear programs:
        the matrix of each pair becomes a multiple of the unit matrix."""
        solution, bank = self.solve(body, numpy.zeros(len(body.names)))
        body = body.leave_doubtful(solution, numpy.zeros(len(body.names)))
        pairs = targets.find_pairs(solution, WIDEST_PAIR)
        if max(numbers) > len(pairs):
            raise targets.InputError(f"--close-pairs {max(numbers)}: this body has {len(pairs)} pairs within {WIDEST_PAIR:g} cents")
        if kept and max(kept) > len(solution.kinds):
            raise targets.InputError(f"--keep {max(kept)}: {len(solution.kinds)} modes were solved")
        groups = [pairs[number - 1] for number in numbers]
        first = state = Pairs(numpy.zeros(len(body.names)), solution, groups, bank)
        missed = numpy.zeros(len(groups))
        for _ in range(MAX_CLOSING):
            self.steps.append(("given", state.off_cents.tolist(), state.p.tolist()))
            self.say(f"solve {self.run.solves}: beats of " + ", ".join(f"{cents:.3f}" for cents in state.off_cents) + " cents")
            if state.off_cents.max() <= self.cents:
                break
            p, missed = self.find_cuts(body, state, kept)
            if numpy.abs(p - state.p).max() < 1e-8:
                break
            solution, bank = self.solve(body, p)
            after = Pairs(p, solution, follow(state, solution)[0], bank)
            if after.off_cents.max() >= state.off_cents.max():
                break
            state = after
        reached = bool(state.off_cents.max() <= self.cents)
        obstacle = ""
        if not reached:
            worst = int(state.off_cents.argmax())
            deepest = body.names[int((state.p - body.high).argmax())]
            obstacle = f"pair {numbers[worst]} keeps {state.off_cents[worst]:.2f} cents: within the depths allowed, first order leaves "
            obstacle += f"{missed.max():.2f}; the deepest cut is at {deepest}"
        return Outcome(first, state, body, self.find_splits(body, state)[0], reached, obstacle, self.steps)

    def find_splits(self, body, state):
        """Derivatives (pairs, K) of the splits, and of the off-diagonal entries [cents per m]; None for those a bank has not."""
        entries = shapes.calc_entries(body, state)
        of = {frozenset(map(int, pair)): column for column, pair in enumerate(state.solution.sites.columns)}
        splits = numpy.array([entries[of[frozenset([j])]] - entries[of[frozenset([i])]] for i, j in state.groups])
        return splits, [entries[of[frozenset(pair)]] if frozenset(pair) in of else None for pair in state.groups], entries, of

    def find_cuts(self, body, state, kept):
        """(p, missed cents) of the linear program: least volume, equations with a dear slack."""
        splits, mixed, entries, of = self.find_splits(body, state)
        a, y = [*splits], [*-state.splits]
        for row in mixed:
            if row is not None:
                a.append(row)
                y.append(0.0)
        for mode in kept:
            a.append(entries[of[frozenset([mode - 1])]])
            y.append(0.0)
        a, y = numpy.array(a) * body.step, numpy.array(y)
        count, rows = len(state.p), len(y)
        volume = body.volumes * body.step / (body.volumes * body.step).sum()
        limits = [((low - p) / step, (high - p) / step) for low, high, p, step in zip(body.low, body.high, state.p, body.step)]
        found = scipy.optimize.linprog(
            numpy.concatenate([volume, numpy.full(2 * rows, DEAR)]),
            A_eq=numpy.concatenate([a, numpy.eye(rows), -numpy.eye(rows)], axis=1),
            b_eq=y,
            bounds=limits + [(0, None)] * (2 * rows),
        )
        p = numpy.clip(state.p + found.x[:count] * body.step, body.low, body.high)
        return p, numpy.abs(a @ found.x[:count] - y)

    def check_aparts(self, solution):
        """InputError for modes to stay away from that are not there."""
        for apart in self.aparts:
            if not targets.find_kind(solution, apart.kind):
                known = targets.list_kinds(solution)
                raise targets.InputError(f"--apart {apart.kind}: not among the lowest {len(solution.kinds)} modes of this body; {known}")

    def find_obstacle(self, body, state, jacobian):
        """The worst mode, the bound that a step towards the wishes presses hardest upon, and modes that hardly stay away."""
        near = [
            f"--apart {apart.kind}:{apart.cents:g}"
            for apart in self.aparts
            for group in targets.find_kind(state.solution, apart.kind)
            for wished in state.groups
            if not set(group) & set(wished) and abs(targets.to_cents(state.solution, group[0], wished[0])) < NEAR_APART * apart.cents
        ]
        also = f"; {near[0]} stands against it" if near else ""
        worst = int(numpy.argmax(numpy.abs(self.weights * state.off_cents)))
        name = self.wishes[worst].mode or f"the mode near {self.wishes[worst].hz:.6g} Hz"
        pull = -(jacobian * self.weights[:, None]).T @ (self.weights * state.off_cents) * body.step  # wish to raise p
        slack = 1e-3 * (body.high - body.low)
        down = numpy.where((state.p <= body.low + slack) & (pull < 0), -pull, 0)
        up = numpy.where((state.p >= body.high - slack) & (pull > 0), pull, 0)
        text = f"{name} stays {state.off_cents[worst]:+.1f} cents off"
        if max(down.max(), up.max()) <= 0:
            return text + (also or ": no bound is in the way, but no cut within first order helps all wishes (a local minimum)")
        at, is_up = (int(up.argmax()), True) if up.max() >= down.max() else (int(down.argmax()), False)
        return f"{text}: {body.names[at]}, {body.ceiling if is_up else body.floor}{also}"
