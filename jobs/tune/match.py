"""carillon match: a recording or a list of peaks to a material with uncertainties."""
import csv
import dataclasses
import json
import math
import pathlib

import numpy

import charts
import constants
import job_file
import losses
import measuring
import programs
import results
import solver
import sound
from errors import InputError
from quantities import LENGTH_UNITS, MASS_UNITS, read_quantity

FILES = ("material.json", "peaks.csv", "spectrum.svg")
T60_RANGE_S = (1e-4, 1e4)  # of a table of peaks
COLUMNS = {"hz": True, "sd_hz": False, "t60_s": False, "sd_t60_s": False}  # is it required


def add_command(commands):
    one = commands.add_parser(
        "match",
        help="elastic constants and losses of a body from a recording of one strike",
        description="Fits the material of a job's body to a recording of one strike, or to a table of peaks. Writes a material file, the "
        "peaks and a picture.",
    )
    one.add_argument("job", metavar="JOB.json", help="job of carillon-precompute: the body, with a material near to the true one")
    one.add_argument("sound", metavar="SOUND.wav|PEAKS.csv", help="one strike, or a table with the columns hz, sd_hz, t60_s, sd_t60_s")
    one.add_argument("-o", "--out", metavar="FOLDER", default="matched", help="output folder (default: matched)")
    one.add_argument("--mass", type=read_quantity(MASS_UNITS), metavar="0.2kg", help="weighed mass; gives the density")
    one.add_argument(
        "--tolerance",
        type=read_quantity(LENGTH_UNITS),
        metavar="0.05mm",
        help="standard deviation of each size of the body (default: none)",
    )
    one.add_argument("--bin", metavar="FOLDER", help="folder of carillon-precompute (default: next to this program)")
    one.add_argument("--timeout", type=programs.read_seconds, default=3600, help="limit of one solve in seconds (default: 3600)")
    one.add_argument("--json", action="store_true", help="print one JSON document; other output goes to standard error")
    one.set_defaults(run=run)


def read_peaks(path):
    """[Peak] of a CSV file, ascending. InputError with the line."""
    remedy = "give a table whose first row is hz,sd_hz,t60_s,sd_t60_s (hz alone is enough)"
    try:
        rows = list(csv.reader(job_file.read_text(path, "table of peaks", remedy).splitlines()))
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as a table: {error}; {remedy}") from None
    head = [name.strip().lower() for name in rows[0]] if rows else []
    if "hz" not in head:
        raise InputError(f"{path}:1: has no column hz; {remedy}")
    peaks = []
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        values = {}
        for name, cell in zip(head, row):
            if name in COLUMNS and cell.strip():
                try:
                    values[name] = float(cell)
                except ValueError:
                    values[name] = math.nan
                if not (math.isfinite(values[name]) and values[name] > 0):
                    raise InputError(f"{path}:{number}: {name} is {cell.strip()!r}; give a number above 0")
        if not 1 <= values.get("hz", 0) <= 1e6:
            raise InputError(f"{path}:{number}: hz is missing or beyond 1 to 1e6; {remedy}")
        hz, t60_s = values["hz"], values.get("t60_s")
        if t60_s and not T60_RANGE_S[0] <= t60_s <= T60_RANGE_S[1]:
            raise InputError(f"{path}:{number}: t60_s is {t60_s:g}; give {T60_RANGE_S[0]:g} to {T60_RANGE_S[1]:g} s, or leave it empty")
        decay = sound.T60_DECAY / t60_s if t60_s else None
        sd_decay = decay * values["sd_t60_s"] / t60_s if t60_s and "sd_t60_s" in values else math.inf
        peaks.append(sound.Peak(hz, values.get("sd_hz", 0.0), decay, sd_decay))
    if not peaks:
        raise InputError(f"{path}: has no peaks; {remedy}")
    if len(peaks) > 100:
        raise InputError(f"{path}: {len(peaks)} peaks; give the 100 strongest at most")
    return sorted(peaks, key=lambda peak: peak.freq_hz)


def round_to(value, sd):
    """The value with as many digits as its standard deviation has two of."""
    digits = max(0, 1 - math.floor(math.log10(sd))) if sd > 0 and math.isfinite(sd) else 3
    return f"{value:.{min(digits, 9)}f}"


@dataclasses.dataclass(frozen=True)
class Row:
    """A constant of the result; sd: standard deviation in the unit of the value; None if the peaks do not resolve it."""

    name: str
    value: float
    sd: float | None

    def describe(self):
        factor, unit = (1e-9, " GPa") if self.name[0] in "EG" else (1.0, "")
        if self.sd is None:
            return f"{self.name} {factor * self.value:.4g}{unit}, of the job: these peaks do not resolve it"
        value, sd = factor * self.value, factor * self.sd
        share = f" ({100 * sd / value:.2g} %)" if unit else ""
        return f"{self.name} {round_to(value, sd)} +- {sd:.2g}{unit}{share}"


class Match:
    """All that was found. out: folder."""

    def __init__(self, options):
        self.options = options
        is_sound = pathlib.Path(options.sound).suffix.lower() in (".wav", ".wave")
        self.hearing = sound.hear(*sound.read_wav(options.sound)) if is_sound else None
        self.peaks = self.hearing.peaks if is_sound else read_peaks(options.sound)
        self.notes = list(self.hearing.notes) if is_sound else []
        job = solver.read_job(options.job)
        made = solver.Solver(programs.find_program(options.bin), options.job, options.timeout)
        self.matcher = constants.Matcher(made, job, self.peaks, options.tolerance)
        self.fit, self.model, rivals = self.matcher.fit()
        self.solution = self.model.solution
        self.weigh()
        self.make_rows()
        self.describe_fit(rivals)
        self.mode_of = {peak: mode for mode, peak in self.fit.pairs}
        self.laws = losses.fit_laws([self.peaks[peak] for peak in self.mode_of])
        if self.laws and self.hearing and self.hearing.room_t60_s:
            self.notes.append("the loss law is that of a room recording: take it as a start")

    def weigh(self):
        """The density of the body, and the factor of all moduli that follows, since frequencies fix moduli / density only."""
        self.density = self.matcher.material["density_kg_m3"]
        self.factor = 1.0
        if self.options.mass:
            weighed = self.options.mass / self.solution.volume_m3
            self.factor, before, self.density = weighed / self.density, self.density, weighed
            if abs(self.factor - 1) > 0.005:
                self.notes.append(
                    f"the mass gives a density of {weighed:.0f} kg/m^3, not {before:.0f} as in the job. If that is right, the volume is"
                    f" {100 * (self.factor - 1):+.1f} % off, and with it a size: all moduli hold for the sizes of the job"
                )

    def make_rows(self):
        self.rows = []
        sds = numpy.sqrt(numpy.diag(self.fit.covariance))
        for constant, x, sd, resolved in zip(self.matcher.constants, self.fit.x, sds, self.fit.resolved):
            value = constant.get_value(x)
            is_modulus = constant.name[0] in "EG"
            value, sd = value * (self.factor if is_modulus else 1.0), sd if constant.is_plain else sd * value
            self.rows.append(Row(constant.name, value, sd * (self.factor if is_modulus else 1.0) if resolved else None))

    def describe_fit(self, rivals):
        fit, notes = self.fit, self.notes
        unresolved = [row.name for row in self.rows if row.sd is None]
        if unresolved:
            notes.append(f"{', '.join(unresolved)}: kept as in the job; their doubt is in the deviations of the others")
        for factor in rivals:
            notes.append(
                f"another assignment is about as good, with moduli of {factor:.2f} times these; give more peaks or a nearer material"
            )
        extra = len(self.peaks) - len(fit.pairs)
        if extra:
            left = ", ".join(f"{peak.freq_hz:.1f}" for k, peak in enumerate(self.peaks) if k not in {j for _, j in fit.pairs})
            notes.append(f"{extra} of {len(self.peaks)} peaks are no modes of this body: {left} Hz")
        heard, modes = self.matcher.count_heard(fit, self.model)
        if heard < constants.HEARD * modes:
            notes.append(
                f"only {heard} of {modes} modes up to the highest peak are heard: so few may fit by chance; check sizes, support and"
                " material of the job before you use these constants"
            )
        young = self.rows[0]
        for key, least, power in self.matcher.find_hidden_sizes(fit, self.model):
            if least > 0.01 and abs(power) > 0.2 and young.sd:
                size = self.matcher.sizes[key]
                fixed = young.value * size**power / self.density
                shown = f"an error of {key} below {100 * least:.1f} %" if least < 0.5 else f"no error of {key}"
                verb = "would not show" if least < 0.5 else "would show"
                notes.append(
                    f"{key} and {young.name} are not distinguished: {shown} {verb}. Well known is {young.name} {key}^{power:.2f} / density"
                    f" = {fixed:.5g} (SI); 1 % more {key} gives {-power:+.1f} % of {young.name}"
                )
        reasons = []
        low, high = constants.SOLID_NU
        is_solid = low < self.matcher.material.get("poisson_ratio", 0) < high  # of a job that expects more or less, it says nothing
        if is_solid and any(row.name == "nu" and row.sd is not None and not low < row.value < high for row in self.rows):
            reasons.append("Poisson's ratio is at the limit of solids")
        if len(fit.pairs) > sum(fit.resolved) and fit.chi2 > constants.WRONG_CHI2:
            reasons.append(f"chi2 is {fit.chi2:.1f} per degree of freedom")
        if extra > 0.3 * len(self.peaks):
            reasons.append(f"{extra} of {len(self.peaks)} peaks are left over")
        named = self.matcher.find_wrong_size(fit, self.model) if reasons else None
        self.is_wrong = bool(reasons) and (bool(named) or not reasons[-1].endswith("left over"))
        if self.is_wrong:
            notes.append(f"the shape of the body is wrong, or peaks are not its modes: {'; '.join(reasons)}. Do not use these constants")
        elif reasons:
            notes.append("many peaks are left over: check sizes, support and material of the job before you use these constants")
        if named:
            key, value, count = named
            notes.append(
                f"{key} = {value:.4g} instead of {self.matcher.sizes[key]:.4g} fits best, with {count} of {len(self.peaks)} peaks;"
                " measure it, and match again"
            )

    def make_material(self):
        """The entry of a materials file."""
        material = constants.make_material(self.matcher.material, self.matcher.constants, self.fit.x)
        material = {key: value for key, value in material.items() if key not in ("name", "from")}
        resolved = "; ".join(row.describe() for row in self.rows)
        if self.factor != 1.0:
            if "orthotropic" in material:
                wood = material["orthotropic"]
                scaled = {key: [self.factor * value for value in wood[key]] for key in ("young_modulus_pa", "shear_modulus_pa")}
                material["orthotropic"] = wood | scaled
            else:
                material["young_modulus_pa"] *= self.factor
        material["density_kg_m3"] = self.density
        source = f"carillon match, {pathlib.Path(self.options.sound).name}"
        result = {"name": f"{pathlib.Path(self.options.job).stem} matched"} | material | {"elasticity_source": f"{source}: {resolved}"}
        if self.laws:
            result |= {"damping": self.laws[0].damping, "loss_source": f"{source}: {self.describe_law()}"}
        return result

    def describe_law(self):
        law = self.laws[0]
        values = ", ".join(f"{value:.3g} +- {sd:.2g}" for value, sd in zip(law.values, law.deviations))
        others = ", ".join(f"{other.name} {other.aic - law.aic:+.0f}" for other in self.laws[1:])
        return f"{law.name}: {values}" + (f" (AIC of others: {others})" if others else "")

    def list_modes(self):
        """[[mode, Hz of the body, its bar, Hz heard, deviation in cents, T60, level]]: the text of each cell, with a head."""
        logs = self.model.predict(self.fit.x)
        peak_of = dict(self.fit.pairs)
        rows = [["mode", "body Hz", "bar cents", "heard Hz", "off cents", "T60 s", "dB"]]
        for mode in numpy.argsort(logs):
            if mode not in peak_of and logs[mode] > math.log(self.peaks[-1].freq_hz):
                continue
            cells = [str(mode + 1), f"{math.exp(logs[mode]):.2f}", f"{self.solution.bar_cents[mode]:.1f}"]
            if mode in peak_of:
                peak = self.peaks[peak_of[mode]]
                off = constants.TO_CENTS * (math.log(peak.freq_hz) - logs[mode])
                t60 = f"{sound.T60_DECAY / peak.decay_per_s:.3g}" if peak.decay_per_s else "-"
                cells += [f"{peak.freq_hz:.2f}", f"{off:+.1f}", t60, f"{peak.level_db:.0f}" if self.hearing else "-"]
            else:
                cells += ["-", "-", "-", "-"]
            rows.append(cells)
        return rows

    def describe(self):
        lines = [measuring.format_table(self.list_modes()), ""]
        lines += [row.describe() for row in self.rows]
        lines.append(f"density {self.density:.5g} kg/m^3" + ("" if self.options.mass else ", of the job: moduli scale with it"))
        if not self.options.tolerance and self.matcher.sizes:
            lines.append("deviations hold for the sizes of the job as given; --tolerance 0.05mm adds that of the sizes")
        lines.append(f"losses {self.describe_law()}" if self.laws else "losses of the job: no decays were given")
        return "\n".join(lines + [f"note: {note}" for note in self.notes])

    def to_json(self):
        found = {row.name: {"value": row.value, "sd": row.sd} for row in self.rows}
        return {
            "constants": found,
            "density_kg_m3": self.density,
            "chi2": self.fit.chi2,
            "is_wrong_shape": self.is_wrong,
            "law": self.laws[0].damping if self.laws else None,
            "peaks": [
                {"hz": peak.freq_hz, "decay_per_s": peak.decay_per_s, "mode": self.mode_of[k] + 1 if k in self.mode_of else None}
                for k, peak in enumerate(self.peaks)
            ],
            "notes": self.notes,
        }

    def write(self, out):
        (out / "material.json").write_text(json.dumps({"materials": [self.make_material()]}, indent=1) + "\n")
        with open(out / "peaks.csv", "w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow([*COLUMNS, "mode", "level_db"])
            for k, peak in enumerate(self.peaks):
                t60 = sound.T60_DECAY / peak.decay_per_s if peak.decay_per_s else math.nan
                sd_t60 = t60 * peak.sd_per_s / peak.decay_per_s if peak.decay_per_s and math.isfinite(peak.sd_per_s) else math.nan
                cells = [f"{value:.6g}" if value > 0 else "" for value in (peak.sd_hz, t60, sd_t60)]
                writer.writerow([f"{peak.freq_hz:.8g}", *cells, self.mode_of.get(k, -1) + 1 or "", f"{peak.level_db:.1f}"])
        (out / "spectrum.svg").write_text(self.draw())

    def draw(self):
        """SVG: spectrum of the recording, or its peaks, over the modes of the body."""
        modes_hz = numpy.exp(self.model.predict(self.fit.x))
        low, high = 0.7 * self.peaks[0].freq_hz, 1.4 * self.peaks[-1].freq_hz
        axes = charts.Axes(84, 70, 760, 380, (low, high), (-80.0, 5.0), y_log=False)
        title = f"{pathlib.Path(self.options.sound).name} over the modes of {pathlib.Path(self.options.job).name}"
        legend = "grey: spectrum; lines: modes of the body, blue where heard, red where not; dots: peaks, red if no mode"
        out = charts.start(880, 520, title, legend)
        ticks = [tick for power in range(0, 6) for tick in (10**power, 2 * 10**power, 5 * 10**power) if low < tick < high]
        out += axes.draw_frame("frequency [Hz]", "level [dB]", ticks, range(-80, 1, 20))
        heard = {mode for mode, _ in self.fit.pairs}
        for mode, hz in enumerate(modes_hz):
            if low < hz < high:
                out.append(axes.draw_curve([(hz, -80), (hz, 5)], "#2f6690" if mode in heard else "#e3a79c", 1.2))
        if self.hearing:
            out.append(axes.draw_curve(make_spectrum(self.hearing, low, high), "#777777", 1.0))
        for k, peak in enumerate(self.peaks):
            mode = self.mode_of.get(k)
            text = f"{peak.freq_hz:.2f} Hz, " + ("no mode of the body" if mode is None else f"mode {mode + 1}")
            out.append(axes.draw_point(peak.freq_hz, max(peak.level_db, -78.0), "#c8553d" if mode is None else "#2f6690", text, "white"))
        return "\n".join(out) + "\n</svg>\n"


def make_spectrum(hearing, low, high, columns=1500):
    """[(hz, dB)]: the largest level in each of so many columns, even in log f."""
    part = hearing.samples[: round(1.2 * hearing.rate_hz)]
    level = 20 * numpy.log10(numpy.abs(numpy.fft.rfft(part * numpy.hanning(len(part)))) + 1e-30)
    hz = numpy.fft.rfftfreq(len(part), 1 / hearing.rate_hz)
    edges = numpy.searchsorted(hz, low * (high / low) ** (numpy.arange(columns + 1) / columns))
    inside = [(begin, end) for begin, end in zip(edges, edges[1:]) if end > begin]
    top = max(level[begin:end].max() for begin, end in inside)
    return [(hz[begin:end].mean(), max(level[begin:end].max() - top, -80.0)) for begin, end in inside]


def run(options):
    """Matches, writes the files, and returns (text, JSON object)."""
    with results.make_folder(options.out, FILES) as out:
        made = Match(options)
        made.write(out)
    files = [str(out / name) for name in FILES]
    return made.describe() + "\n" + "\n".join(files), made.to_json() | {"files": files}
