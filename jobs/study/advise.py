"""`carillon study advise BODY --cents 5 [--seconds 10]`: recommends a setting, predicts its error and cost, and reports the result.

Bodies of the study are predicted from its measurements, others from coarse solves (forecast.Probe). CPU seconds are scaled to this machine
by one small solve.
"""
import argparse
import contextlib
import dataclasses
import difflib
import json
import math
import os
import pathlib
import pkgutil
import shutil
import subprocess
import sys
import tempfile
import threading
import time

import answer
import bodies
import forecast
import job_file
import programs
import targets
from lab import Case, Lab
from errors import InputError, RunError, printable
from measuring import to_cents

RANKS_FROM_S = 4.0  # CPU seconds above which a second rank reduces the wall time
PROBE_NODES, PROBE_GROWTH, MAX_PROBE_NODES = {"shape": 1000, "surface": 2500}, {"shape": 3, "surface": 2}, 60000
TRIAL_TOLERANCE = 1e-6
START_S = 0.15  # CPU seconds of the start, in no phase of the record
BUDGET_MARGIN = 0.85  # fraction of --seconds that is used
CHECK_GROWTH = 2.5  # factor of the nodes for --check
LONG_S, MANY_NODES = 10.0, 45000  # solve of a mesh file, coarsest mesh of a surface: above these an estimate is printed first
MAX_CENTS, MAX_SECONDS = 2400.0, 1e6
PROGRAMS = ("carillon-precompute", "carillon-mesh", "carillon-bank")


@dataclasses.dataclass
class Outcome:
    """Result of a run. how: "known" frequencies, the study's "extrapolated" ones, a "finer" mesh, or error "bars"."""

    cents: float
    mode: int
    bar: float
    how: str
    cpu_s: float
    wall_s: float
    nodes: int
    modes: int


class KnownTarget:
    """A body of the study."""

    def __init__(self, body, advice):
        self.body, self.name, self.kind, self.has_surface, self.is_round = body, body.name, "study", body.surface, body.round
        self.notes = [f"the study's {body.name}: {body.summary}; its lowest {body.modes} modes"]
        truth = {} if body.truth else advice.content.get("truths", {}).get(body.name, {})
        self.truth_hz = list(body.truth.freq_hz) if body.truth else truth.get("freq_hz", [])
        self.how = "known" if body.truth else "extrapolated"
        self.doubt_cents = max((to_cents(1 + doubt, 1) for doubt in truth.get("uncertainty", [])), default=0.0)
        if self.doubt_cents > 1:
            self.notes.append(
                "its frequencies are not known: errors are relative to the study's finest curved T10, extrapolated, which may be"
                f" {answer.show(self.doubt_cents)} cents wrong themselves"
            )

    def list_files(self):
        return []

    def make_case(self, lab, setting, name):
        element, _, mass = setting.element.partition(" ")
        kind = bodies.find_kind(f"T4 {mass or 'consistent'}" if element == "T4" else "T10 curved" if self.body.round else "T10 straight")
        case = self.body.make_case(lab, kind, setting.nodes, setting.ranks, name, solver={"tolerance": setting.tolerance})
        return case


class OwnTarget:
    """Another body: a shape, a surface, a mesh, a job."""

    def __init__(self, target):
        self.target, self.name, self.kind, self.notes, self.truth_hz = target, target.name, target.kind, target.notes, []
        self.has_surface, self.is_round = target.kind == "surface", target.kind != "mesh"

    def list_files(self):
        return self.target.list_files()

    def make_case(self, lab, setting, name):
        return Case(f"{self.name}, {name}", self.target.make_job(setting), setting.ranks)


class Adviser:
    def __init__(self, options, tools, advice):
        self.options, self.advice = options, advice
        self.target = self.find_target(options.body)
        self.check_folder()
        if self.target.kind != "study" or self.target.name not in advice.curves:
            for element in ("T4", "T10") if self.target.kind == "mesh" else ("T10",):
                if len(advice.find_bar_ratios(element)) < 2:
                    raise InputError(
                        f"{options.advice}: it has too few meshes of {element} to predict {self.target.name} from; take the advice of a"
                        " study of more bodies"
                    )
        self.lab = Lab(options.out, tools, repeats=1, surface=options.surface)
        self.lab.say = lambda text: None  # messages are printed here
        self.cores = len(os.sched_getaffinity(0))
        self.probe, self.probe_cpu_s = None, 0.0
        self.predicted = {}  # CPU seconds by (element, nodes, modes)
        self.pace = 1.0  # CPU seconds of this machine / machine of the study

    def find_target(self, word):
        target = self.name_target(word)
        if self.options.check and target.kind == "mesh":
            raise InputError(f"{word}: --check needs a finer mesh, and none can be made of a mesh file here")
        return target

    def check_folder(self):
        """InputError if an output would overwrite an input."""
        given = [self.options.body, *self.target.list_files()]
        for kept in self.find_kept():
            if kept.exists() and any(os.path.exists(path) and os.path.samefile(kept, path) for path in given):
                raise InputError(f"{kept}: would be overwritten; give another folder with -o")

    def find_kept(self):
        """Paths (job, bank) in the output folder."""
        name = pathlib.Path(self.target.name).stem
        return [pathlib.Path(self.options.out).resolve() / f"{name}.{ending}" for ending in ("json", "hdf")]

    def name_target(self, word):
        known = bodies.make_bodies()
        if word in known:
            if self.options.wall or self.options.height or self.options.band:
                raise InputError(f"{word}: --wall, --height and --band are for bodies of your own; the study's has its own")
            if self.options.check:
                raise InputError(f"{word}: --check is for bodies of your own; the study gives the frequencies of its own bodies")
            return KnownTarget(bodies.choose([word], self.options.surface)[0], self.advice)
        target = targets.find_target(word, self.options.wall, self.options.height, self.options.band)
        if target is None:
            near = difflib.get_close_matches(word, [*known, *targets.SHAPES], 1)
            raise InputError(
                f"{word}: there is no such file, and no body of the study ({', '.join(known)}) or shape ({', '.join(targets.SHAPES)})"
                + (f'; did you mean "{near[0]}"?' if near else "")
            )
        return OwnTarget(target)

    # --- before

    def say(self, text):
        """Prints progress."""
        print(f"carillon-study: {printable(text)}", file=sys.stderr, flush=True)

    @contextlib.contextmanager
    def doing(self, text):
        """Prints a message, repeatedly while the work continues."""
        self.say(text)
        done, begin = threading.Event(), time.monotonic()

        def beat():
            for number in range(10**6):
                if done.wait(3 if number < 5 else 15):
                    return
                self.say(f"still {text}, {time.monotonic() - begin:.0f} s")

        thread = threading.Thread(target=beat, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def estimate(self):
        """The prediction of carillon-precompute --validate for a surface or mesh file whose trials take long; None for other bodies."""
        if self.target.kind not in ("surface", "mesh"):
            return None
        with self.doing(f"predicting the cost of {self.target.name}"):
            found = self.validate()
        if found is None:
            return None
        # A surface that is not thin has a few thousand nodes in its first trial, whatever its usual mesh takes.
        is_thin = self.target.kind == "surface" and found["mesh"]["nodes"] > MANY_NODES
        is_long = self.target.kind == "mesh" and found["cpu_seconds"] > LONG_S
        return found if is_thin or is_long else None

    def validate(self):
        """The document of carillon-precompute --validate, whose work is bounded by the size of the body; None for an error."""
        setting = forecast.Setting("T10", PROBE_NODES["surface"], TRIAL_TOLERANCE)
        job = self.target.target.make_job(setting) | {"bank": "bank.hdf"}
        job.get("body", {}).pop("nodes", None)  # what its thickness needs
        with tempfile.TemporaryDirectory(dir=self.lab.runs) as folder:
            file = pathlib.Path(folder) / "job.json"
            file.write_text(json.dumps(job))
            command = [self.lab.find_program("carillon-precompute"), "--validate", "--json", "--quiet", file]
            done = subprocess.run(command, capture_output=True, text=True, errors="surrogateescape", stdin=subprocess.DEVNULL)
        if done.returncode != 0:
            return None  # the first trial reports it
        return json.loads(done.stdout)

    def calibrate(self):
        """Speed of this machine relative to that of the study, by a small solve."""
        known = self.advice.get_calibration()
        with self.doing("measuring the speed of this machine"):
            solve = self.lab.measure([Case("calibration", known["job"])], 2, is_fresh=True)["calibration"]
        self.pace = min(max(min(solve.cpu_s) / known["cpu_s"], 0.05), 20.0)

    def find_curves(self):
        """Candidate curves, in seconds of this machine."""
        curves = self.advice.curves.get(self.target.name) if self.target.kind == "study" else None
        if curves is None:
            return [self.try_coarse().make_curve()]
        return [
            forecast.Curve(curve.element, [dataclasses.replace(s, cpu_s=s.cpu_s * self.pace) for s in curve.samples])
            for curve in curves.values()
            if curve.element != "T10 straight"
        ]

    def try_mesh(self):
        """[(Setting, Solve, cents)] of a mesh file with both elements."""
        tried = []
        for element in ("T4", "T10"):
            setting = forecast.Setting(element, 0, forecast.find_tolerance(self.options.cents or 1.0))
            solve = self.solve(setting, f"{element} on the mesh file")
            self.probe_cpu_s += solve.cpu
            if solve.freq_hz:
                tried.append((setting, solve, max(solve.bar_cents) / self.advice.find_usual_ratio(element)))
        if not tried:
            raise InputError(
                f'{self.target.name}: no mode was found in the band; give another band (--band LOW,HIGH, or "band_hz" of the job)'
            )
        return tried

    def choose_for_mesh(self):
        cents, seconds = self.options.cents, self.options.seconds
        tried = [
            forecast.Forecast(dataclasses.replace(setting, nodes=solve.nodes), worst, solve.cpu, min(solve.wall_s))
            for setting, solve, worst in self.try_mesh()
        ]
        affordable = [f for f in tried if seconds is None or f.cpu_s <= seconds]
        best = min(tried, key=lambda f: f.cents)
        if not affordable:
            raise InputError(
                f"{self.target.name}: {seconds:g} CPU s are too few for this mesh: T4 takes {tried[0].cpu_s:.2g}; give more, or a coarser"
                " mesh"
            )
        enough = [f for f in affordable if cents is not None and f.cents <= cents]
        if enough:
            return min(enough, key=lambda f: f.cpu_s), ""
        if cents is not None and seconds is None:
            raise InputError(
                f"{self.target.name}: {cents:g} cents are out of reach of this mesh file, which comes to about {best.cents:.2g} with"
                f" {best.setting.element} ({best.cpu_s:.2g} CPU s); give a finer mesh, the surface or shape itself, or --cents"
                f" {math.ceil(best.cents * 110) / 100:g}"
            )
        chosen = min(affordable, key=lambda f: f.cents)
        return (
            chosen,
            (
                ""
                if cents is None
                else f"{cents:g} cents are out of reach of this mesh file within {seconds:g} CPU s; about {chosen.cents:.2g} can be had"
            ),
        )

    def try_coarse(self):
        """Solves of a body that the study does not have, each on three times the nodes of the one before, until what is asked comes within
        reach."""
        self.probe = forecast.Probe(self.advice, "T10", self.predict_seconds)
        kind = "surface" if self.target.has_surface else "shape"
        nodes, growth = PROBE_NODES[kind], PROBE_GROWTH[kind]
        while True:
            try:
                trial = self.try_one(nodes)
            except RunError as error:
                if not error.possible_nodes or error.possible_nodes <= nodes:
                    raise
                nodes = math.ceil(1.05 * error.possible_nodes)  # thin walls need more nodes
                continue
            self.probe_cpu_s += trial.cpu_s
            self.probe.trials.append(trial)
            if nodes * growth > MAX_PROBE_NODES or self.is_within_reach():
                break
            nodes *= growth
        if not trial.freq_hz:
            raise InputError(
                f"{self.target.name}: no mode was found in the band on {trial.nodes:,} nodes; give another band (--band LOW,HIGH, or"
                ' "band_hz" of the job)'
            )
        return self.probe

    def predict_seconds(self, element, nodes, modes):
        """CPU seconds on one rank by the cost model of carillon-precompute."""
        key = (element, nodes, modes)
        if key not in self.predicted:
            size = json.dumps({"element": element, "nodes": nodes, "modes": modes})
            command = [self.lab.find_program("carillon-precompute"), "--estimate", size]
            done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
            if done.returncode != 0:
                raise RunError(done.returncode, f"carillon-precompute --estimate failed: {printable(done.stderr.strip())}")
            self.predicted[key] = json.loads(done.stdout)["cpu_seconds"]
        return self.predicted[key]

    def is_within_reach(self):
        """True if the request is within reach of the trials."""
        trials, options = self.probe.trials, self.options
        if len(trials) < 2 or not trials[-2].freq_hz:
            return len(trials) > 2  # no modes in three trials
        curve = self.probe.make_curve()
        if options.cents is not None and curve.find_nodes(options.cents) is not None:
            return True
        return options.seconds is not None and curve.predict_cpu(curve.get_max_nodes()) > options.seconds

    def try_one(self, nodes):
        return self.make_trial(self.solve(forecast.Setting("T10", nodes, TRIAL_TOLERANCE), f"trial of {nodes} nodes"), nodes)

    def make_trial(self, solve, nodes):
        phases_s = sum(phase.get("cpu_seconds", phase["seconds"]) for phase in solve.record["stations"])
        mesh_s = max(solve.cpu - phases_s - START_S, 0.0) if self.target.kind == "surface" else 0.0
        return forecast.Trial(nodes, solve.unknowns, solve.freq_hz, solve.bar_cents, solve.cpu, mesh_s)

    def solve(self, setting, name):
        case = self.target.make_case(self.lab, setting, name)
        with self.doing(f"solving: {name}"):
            return self.lab.measure([case], is_fresh=True)[case.name]

    def make_forecast(self, curve, nodes):
        cents = curve.predict_cents(nodes)
        cpu_s = curve.predict_cpu(nodes)
        ranks, (more, wall) = 1, (1.0, 1.0)
        for count in range(2, self.cores + 1):
            if cpu_s >= RANKS_FROM_S and self.advice.has_ranks(count):
                ranks, (more, wall) = count, self.advice.find_rank_cost(count)
        setting = forecast.Setting(curve.element, nodes, forecast.find_tolerance(self.options.cents or cents), ranks)
        return forecast.Forecast(setting, cents, cpu_s * more, cpu_s * wall)

    def choose(self):
        """(Forecast, remark): the cheapest setting for the cents, or the best within the seconds."""
        if self.target.kind == "mesh":
            return self.choose_for_mesh()
        cents, seconds = self.options.cents, self.options.seconds
        curves = self.find_curves()
        best = None
        if cents is not None:
            found = [self.make_forecast(curve, nodes) for curve in curves if (nodes := curve.find_nodes(cents)) is not None]
            best = min(found, key=lambda f: f.cpu_s, default=None)
            if best is None and seconds is None:
                raise InputError(self.describe_reach(curves, cents))
            if best is not None and (seconds is None or best.cpu_s <= seconds):
                return best, ""
        affordable = [
            self.make_forecast(curve, nodes) for curve in curves if (nodes := curve.find_affordable(BUDGET_MARGIN * seconds)) is not None
        ]
        affordable = [f for f in affordable if f.cpu_s <= seconds] or affordable
        if not affordable:
            least = min((curve.predict_cpu(curve.samples[0].nodes) for curve in curves))
            raise InputError(
                f"{self.target.name}: {seconds:g} CPU s are too few: the coarsest mesh takes about {least:.2g}; give --seconds"
                f" {math.ceil(20 * least) / 10:g} or more"
            )
        chosen = min(affordable, key=lambda f: f.cents)
        if cents is None:
            return chosen, ""
        price = f"would take about {best.cpu_s:.1f} CPU s" if best else "are out of reach"
        return chosen, f"{cents:g} cents {price}; in {seconds:g} CPU s about {chosen.cents:.2g} can be had"

    def describe_reach(self, curves, cents):
        finest = min((self.make_forecast(curve, math.floor(curve.get_max_nodes())) for curve in curves), key=lambda f: f.cents)
        least = math.ceil(finest.cents / forecast.GOAL * 100) / 100
        return (
            f"{self.target.name}: {cents:g} cents are out of reach of what the study can predict: the finest mesh,"
            f" {finest.setting.nodes:,} nodes, comes to about {finest.cents:.2g} cents in {finest.cpu_s:.0f} CPU s; give --cents"
            f" {least:g} or more"
        )

    # --- after

    def judge(self, setting, solve):
        bars = solve.bar_cents
        bar = max(bars)
        if self.target.truth_hz:
            errors = [abs(to_cents(f, true)) for f, true in zip(solve.freq_hz, self.target.truth_hz)]
            how = self.target.how
        elif self.options.check:
            finer = self.solve(dataclasses.replace(setting, nodes=round(CHECK_GROWTH * setting.nodes)), "finer mesh, to check")
            slope = self.probe.find_slope(*self.probe.trials[-2:]) if self.probe else 4 / 3
            # Correct for the error of the finer mesh by the rate.
            errors = [abs(to_cents(f, fine)) / (1 - CHECK_GROWTH**-slope) for f, fine in zip(solve.freq_hz, finer.freq_hz)]
            how = "finer"
        else:
            worst = self.probe.judge(self.make_trial(solve, setting.nodes)) if self.probe else bar / self.advice.find_usual_ratio()
            errors = [worst * b / bar for b in bars]
            how = "bars"
        worst = max(errors)
        return Outcome(worst, errors.index(worst) + 1, bar, how, solve.cpu, min(solve.wall_s), solve.nodes, len(solve.freq_hz))

    def keep(self, solve):
        """Writes the job and its bank to the output folder."""
        file, bank = self.find_kept()
        content = json.loads((solve.bank.parent / "job.json").read_text()) | {"bank": bank.name}
        shutil.copyfile(solve.bank, bank)
        file.write_text(json.dumps(content, indent=1) + "\n")
        return file, bank


def read_packed_advice(path=None):
    """That of the package, or of a file that `tests/bench/study/run --write-advice` wrote."""
    if path is None:
        return forecast.read_advice(pkgutil.get_data(__name__, "advice.json").decode())
    remedy = "tests/bench/study/run --write-advice FILE writes one"
    try:
        return forecast.read_advice(job_file.read_text(path, "advice", remedy))
    except (ValueError, KeyError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path}: {f'{error} is missing' if isinstance(error, KeyError) else error}; {remedy}") from None


def run(options):
    """Returns exit code 0; errors are raised."""
    if options.cents is None and options.seconds is None:
        raise InputError("give --cents (allowed frequency error), --seconds (allowed CPU time), or both")
    adviser = Adviser(options, programs.find_all(options.bin, PROGRAMS), read_packed_advice(options.advice))
    with contextlib.redirect_stdout(sys.stderr) if options.json else contextlib.nullcontext():
        estimate = adviser.estimate()
        if estimate:
            print("\n".join(answer.describe_estimate(adviser, estimate, options)), flush=True)
    if not (estimate and options.dry_run):
        return advise(adviser, options)
    if options.json:
        print(json.dumps(answer.make_estimate_document(adviser, estimate), indent=2))
    return 0


def advise(adviser, options):
    """Trials, advice, and result."""
    with contextlib.redirect_stdout(sys.stderr) if options.json else contextlib.nullcontext():
        adviser.calibrate()
        found, remark = adviser.choose()
        print("\n".join(answer.describe_prediction(adviser, found, remark)), flush=True)
        outcome = job = bank = None
        if not options.dry_run:
            solve = adviser.solve(found.setting, "as advised")
            outcome = adviser.judge(found.setting, solve)
            job, bank = adviser.keep(solve)
            print("\n".join(answer.describe_outcome(outcome, options, found) + [f"kept:      {job}, {bank}"]), flush=True)
    if options.json:
        print(json.dumps(answer.make_document(adviser, found, remark, outcome, job, bank), indent=2))
    return 0


def read_positive(most, unit):
    def read(text):
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and 0 < value <= most):
            raise argparse.ArgumentTypeError(f"{text!r}: give a number of {unit} above 0, {most:g} at most")
        return value

    return read


def read_band(text):
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        low = high = math.nan
    if not 0 < low < high < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r}: give two frequencies in Hz, like 20,20000")
    return low, high


def add_command(commands):
    one = commands.add_parser(
        "advise",
        help="the setting for an accuracy in cents or a CPU time, its predicted error and cost, and the result",
        description=(
            "Says which element, mass, mesh size, tolerance and ranks to use for a body, with the error and the CPU seconds to expect, then"
            " solves it so and says what they were. Bodies of the study are predicted from its measurements; others are tried on coarse"
            " meshes first."
        ),
    )
    one.add_argument(
        "body",
        metavar="BODY",
        help=(
            f"a body of the study ({', '.join(bodies.make_bodies())}), a shape"
            f" ({', '.join(name for name in targets.SHAPES if name not in bodies.make_bodies())}), a job (.json), a surface (.obj .stl .ply"
            " .off) or a mesh file; steel where no material is given"
        ),
    )
    one.add_argument("--cents", type=read_positive(MAX_CENTS, "cents"), metavar="C", help="allowed error of any frequency in the band")
    one.add_argument(
        "--seconds",
        type=read_positive(MAX_SECONDS, "CPU seconds"),
        metavar="S",
        help="allowed CPU seconds of the solve, all ranks (without trials and calibration)",
    )
    one.add_argument(
        "--dry-run", action="store_true", help="only print the advice (bodies outside the study are still tried on coarse meshes)"
    )
    one.add_argument("--check", action="store_true", help="bodies outside the study: also solve a mesh of 2.5 times the nodes, and compare")
    one.add_argument("--wall", type=read_positive(1e4, "metres"), metavar="M", help="of a surface file: wall thickness in metres")
    one.add_argument("--height", type=read_positive(1e4, "metres"), metavar="M", help="of a surface file: scaled to this height")
    one.add_argument("--band", type=read_band, metavar="LOW,HIGH", help="Hz; default: the job's, else 20,20000")
    one.add_argument("-o", "--out", metavar="FOLDER", default="advice", help="output folder of job, bank and trials (default: advice)")
    one.add_argument(
        "--surface", metavar="FILE", default=bodies.BUNNY_SURFACE, help="the bunny's surface (default: that of Debian's glmark2-data)"
    )
    one.add_argument(
        "--advice",
        metavar="FILE",
        help="measurements of another study: tests/bench/study/run --write-advice FILE (default: those in this program)",
    )
    one.add_argument("--bin", metavar="FOLDER", help="folder of the programs (default: next to this one)")
    one.add_argument("--json", action="store_true", help="one JSON document on standard output; the rest on standard error")
    return one
