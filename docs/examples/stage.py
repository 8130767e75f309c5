"""What every example does: solve jobs, render scenes, draw, measure, and hold figures against those of a paper or of a closed form."""
import copy
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import time

import measure

HERE = pathlib.Path(__file__).resolve().parent
sys.path.append(str(HERE.parent.parent / "tests/support"))
import provenance

ENVIRONMENT = HERE.parent.parent / "deploy/environment"  # how mpirun starts as any user on a machine of any size
RANKS = 2


def read_json(file):
    """A job or a scene: JSON with // comments."""
    return json.loads(re.sub(r'("(?:[^"\\]|\\.)*")|//[^\n]*', lambda found: found[1] or "", pathlib.Path(file).read_text()))


def change(document, changes):
    """A copy with the values of dotted keys replaced: {"body.nodes": 2000}."""
    document = copy.deepcopy(document)
    for path, value in changes.items():
        *above, last = path.split(".")
        at = document
        for key in above:
            at = at.setdefault(key, {})
        at[last] = value
    return document


def print_table(rows):
    widths = [max(len(str(row[i])) for row in rows) for i in range(len(rows[0]))]
    for index, row in enumerate(rows):
        print("  " + "  ".join(str(cell).ljust(w) if i == 0 else str(cell).rjust(w) for i, (cell, w) in enumerate(zip(row, widths))))
        if index == 0:
            print("  " + "  ".join("-" * w for w in widths))


def format_table(rows):
    """The table in Markdown, all columns but the first right-aligned."""
    head, *body = [[str(cell) for cell in row] for row in rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---", *["--:"] * (len(head) - 1)], *body)) + "\n"


NUMBER = re.compile(r"[-+]?\d[\d,]*\.?\d*(?:e[-+]?\d+)?")


def calc_unit(number):
    """One unit in the last printed digit of a number."""
    digits, _, power = number.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def find_difference(page, run, varying):
    """The first differing cell of the page's and the run's table, as text; None for equal tables. Tolerance: two units of the last digit.
    varying: names of columns left out, such as times and rounding errors."""
    page, run = [[line[2:-2].split(" | ") for line in text.splitlines()] for text in (page, run)]
    if len(page) != len(run) or page[0] != run[0]:
        return f"{len(page)} rows of {', '.join(page[0])} on the page, {len(run)} of {', '.join(run[0])} in the run"
    for old, new in zip(page[2:], run[2:]):
        for head, before, after in zip(page[0], old, new):
            if head in varying:
                continue
            numbers = list(zip(NUMBER.findall(before), NUMBER.findall(after)))
            is_same = NUMBER.sub("", before) == NUMBER.sub("", after)
            for one, other in numbers:
                apart = abs(float(one.replace(",", "")) - float(other.replace(",", "")))
                is_same = is_same and apart <= 2.01 * max(calc_unit(one), calc_unit(other))
            if not is_same:
                return f"{old[0]}, {head}: {before} on the page, {after} in the run"
    return None


class Page:
    """The page of an example with the tables of its runs. Tables of the full form, at their places in the page:

        <!-- begin figures NAME -->
        | ... |
        <!-- end figures NAME -->

    Tables of the short form, which tests run: each in a comment at the end of the page."""

    def __init__(self, file, quick):
        self.file, self.quick = file, quick
        self.text = file.read_text()

    def find(self, name):
        """(begin, end) of a table in the text, or None."""
        begin, end = (
            (f"<!-- short form {name}\n", "-->\n") if self.quick else (f"<!-- begin figures {name} -->\n", f"<!-- end figures {name} -->\n")
        )
        at = self.text.find(begin)
        return None if at < 0 else (at + len(begin), self.text.index(end, at))

    def get(self, name):
        place = self.find(name)
        return self.text[place[0] : place[1]] if place else None

    def list_names(self):
        """Names of the tables shown."""
        return re.findall(r"^<!-- begin figures ([\w-]+) -->$", self.text, re.M)

    def set(self, name, table):
        if place := self.find(name):
            self.text = self.text[: place[0]] + table + self.text[place[1] :]
        else:  # first run of the short form
            self.text += f"\n<!-- short form {name}\n{table}-->\n"


class Stage:
    """One run of one example: `folder` holds its job and scene files, `out` takes what comes of them."""

    def __init__(self, folder, bin_dir, out, quick):
        self.folder, self.bin, self.out, self.quick = folder, bin_dir, out, quick
        self.checks = []
        self.tables = {}  # name: (rows, columns that vary)
        self.pictures = []
        self.pictures_to = folder  # with --pictures
        self.out.mkdir(parents=True, exist_ok=True)

    def run(self, what, *command):
        """Runs a program in the output folder and ends the example when it fails. Seconds."""
        words = [str(word) for word in command]
        print(f"$ {shlex.join(os.path.basename(word) if pathlib.Path(word).parent == self.bin else word for word in words)}", flush=True)
        begin = time.monotonic()
        done = subprocess.run(
            ["bash", "-c", '. "$0"; exec "$@"', ENVIRONMENT, *words], cwd=self.out, capture_output=True, text=True, stdin=subprocess.DEVNULL
        )
        if done.returncode != 0:
            sys.exit(f"{done.stdout}{done.stderr}\n{what} failed (exit code {done.returncode}); its message stands above")
        return time.monotonic() - begin

    def solve(self, job, name, changes=None, quick=None):
        """Solves the job file of the example with some of its values changed (by `quick` too in the short form), as NAME.hdf. The bank's
        facts."""
        document = change(read_json(self.folder / job), {**(changes or {}), **(quick or {} if self.quick else {}), "bank": f"{name}.hdf"})
        (self.out / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n")
        ranks = () if self.quick else ("mpirun", "-np", RANKS)
        seconds = self.run(f"the solve of {name}", *ranks, self.bin / "carillon-precompute", f"{name}.json")
        text = subprocess.run(
            [self.bin / "carillon-bank", "info", "--json", self.out / f"{name}.hdf"], check=True, capture_output=True, text=True
        ).stdout
        bank = json.loads(text)
        print(
            f"  {name}: {bank['element']}, {bank['counts']['nodes']} nodes, {bank['mode_count']} modes,"
            f" {(bank['corrected_frequencies_hz'] or bank['frequencies_hz'])[0]:.2f} Hz and up, {seconds:.1f} s"
        )
        return bank

    def render(self, name, scene, *options, picture=True, may_be_silent=False):
        """Renders a scene (a document) as NAME.wav with spectrogram (`picture`: for the page), trajectory and report, with further options
        of carillon-render; looks at the sound. (rate, samples, report)"""
        (self.out / f"{name}.json").write_text(json.dumps(scene, indent=1) + "\n")
        self.run(
            f"the scene {name}",
            self.bin / "carillon-render",
            f"{name}.json",
            "-o",
            f"{name}.wav",
            "--spectrogram",
            f"{name}-spectrogram.png",
            "--trajectory",
            f"{name}-trajectory.json",
            "--report",
            f"{name}-report.json",
            "--audit",
            "--quiet",
            *options,
        )
        rate, samples = measure.read_wav(self.out / f"{name}.wav")
        report = json.loads((self.out / f"{name}-report.json").read_text())
        peak = abs(samples).max()
        print(
            f"  {name}: {report['duration_s']:.3g} s, {report['contacts']} contacts, {report['modes']} modes, peak"
            f" {report['peak_pa']:.3g} Pa, {report['real_time_factor']:.3g} x real time"
        )
        sane = report["resets"] == 0 and report["impulses_refused"] == 0 and (0.05 < peak < 1.0 or (may_be_silent and peak == 0.0))
        self.expect(f"{name}.wav is loud, not clipped, and nothing was lost", sane)
        energy = report["energy"]
        gained = max(energy["rise_j"], energy["hit_rise_j"])
        self.expect(
            (
                f"{name}: bodies gain {gained:.1g} J of {energy['largest_kinetic_j']:.2g} J from nowhere, modes a share of"
                f" {energy['modes_rise']:.1g}"
            ),
            gained <= 1e-7 * energy["largest_kinetic_j"] + 1e-9 * energy["weight_n"] and energy["modes_rise"] <= 1e-9,
        )
        if picture:
            self.pictures.append(f"{name}-spectrogram.png")
        return rate, samples, report

    def draw(self, picture, *command):
        """A picture by carillon-draw, in the long form only."""
        if self.quick:
            return
        self.run(f"the picture {picture}", self.bin / "carillon-draw", *command, "-o", picture)
        self.pictures.append(picture)

    def show(self, name, rows, varying=()):
        """Prints a table of the example's page. varying: heads of columns that differ from run to run."""
        print_table(rows)
        self.tables[name] = (rows, varying)

    def check_page(self):
        page = Page(self.folder / "README.md", self.quick)
        for name in page.list_names():
            if self.quick and name not in self.tables:
                continue  # a scene left out of the short form
            rows, varying = self.tables[name]
            table = page.get(name)
            difference = find_difference(table, format_table(rows), varying) if table else "it has none yet"
            why = f": {difference}; renew it with docs/examples/run {self.folder.name} --update" if difference else ""
            self.expect(f"the page has the figures of this run, table {name}{why}", not difference)

    def update_page(self):
        page = Page(self.folder / "README.md", self.quick)
        for name in page.list_names():
            if name in self.tables:
                page.set(name, format_table(self.tables[name][0]))
        page.file.write_text(provenance.put(page.text, provenance.describe(f"docs/examples/run {self.folder.name} --update --pictures")))

    def expect(self, what, met):
        self.checks.append((what, bool(met)))

    def compare(self, what, value, wanted, percent):
        """Holds a value against a wanted one; the limit stands in the line that finish() prints."""
        off = 100 * (value / wanted - 1)
        self.expect(f"{what}: {value:.6g}, wanted {wanted:.6g} +- {percent:g} % (off by {off:+.3f} %)", abs(off) <= percent)

    def finish(self, keep_pictures=False, update=False):
        """Prints the checks and returns the failed ones as text, or None. update: writes the figures to the page if all checks are met."""
        if not update:
            self.check_page()
        elif all(met for _, met in self.checks):
            self.update_page()
        if keep_pictures:
            for picture in self.pictures:
                shutil.copy(self.out / picture, self.pictures_to)
        print("\nChecks")
        for what, met in self.checks:
            print(f"  {'ok  ' if met else 'NOT '} {what}")
        print(f"\nHear and see: {self.out}")
        failed = sum(not met for _, met in self.checks)
        return f"{failed} of {len(self.checks)} checks failed" if failed else None
