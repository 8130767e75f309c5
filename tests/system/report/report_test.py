"""The report of a bank as Chromium shows it, compared with the bank and the record as read by h5py and Python.

Programs are in $CARILLON_BIN_DIR. The library is called by write_report.
"""
import html.parser
import json
import math
import os
import pathlib
import re
import stat
import struct
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "web"))
import fixtures  # noqa: E402
from browser import CHROMIUM, Browser, serve  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
SOURCE = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"])
SECTIONS = [
    "pictures",
    "play",
    "modes",
    "proof",
    "errors",
    "residuals",
    "mesh",
    "time",
    "memory",
    "work",
    "size",
    "checks",
    "job",
    "program",
]
VOID = {"meta", "img", "br"}
NOTHING = "/nowhere/carillon-draw"


class Page(html.parser.HTMLParser):
    """The rendered page: texts, tables and charts by section, and everything that could load or run something."""

    tab = None  # one for all pages: opening a tab takes longer than a page

    def __init__(self, file):
        super().__init__(convert_charrefs=True)
        self.source = pathlib.Path(file).read_bytes()
        assert self.source.count(b"<script") == 2, "text of the bank became a script"
        self.tab.go(pathlib.Path(file).as_uri())
        text = self.tab.evaluate("[...document.scripts].forEach((it) => it.remove()), document.documentElement.outerHTML")
        self.stack, self.tags, self.attributes, self.links = [], set(), set(), []
        self.sections, self.text, self.charts, self.tables, self.missing = {}, {}, {}, {}, {}
        self.section, self.title = "head", ""
        self.feed(text)
        self.close()
        assert not self.stack, self.stack

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.add(tag)
        self.attributes |= set(attributes)
        self.links += [attributes[key] for key in ("src", "href") if key in attributes]
        if tag == "section":
            self.section = attributes["id"]
            self.missing[self.section] = attributes.get("class") == "missing"
        if tag == "tr":
            self.tables.setdefault(self.section, []).append([])
        if tag in ("td", "th"):
            self.tables[self.section][-1].append("")
        if tag in ("rect", "circle", "text") or tag == "path":
            self.charts.setdefault(self.section, []).append([tag, attributes, ""])
        if tag not in VOID:
            self.stack.append(tag)

    def handle_endtag(self, tag):
        assert self.stack and self.stack[-1] == tag, (tag, self.stack, self.getpos())
        self.stack.pop()
        if tag == "section":
            self.section = "tail"

    def handle_data(self, data):
        if self.stack and self.stack[-1] == "title" and "circle" in self.stack:
            self.charts[self.section][-1][2] += data
            return
        if self.stack and self.stack[-1] == "title":
            self.title += data
        if self.stack and self.stack[-1] == "text":
            self.charts[self.section][-1][2] += data
        if any(tag in ("td", "th") for tag in self.stack):
            self.tables[self.section][-1][-1] += data
        self.text[self.section] = self.text.get(self.section, "") + data

    def facts(self, section):
        """The rows with three cells, by the first: value and remark."""
        return {row[0]: row[1:] for row in self.tables.get(section, []) if len(row) == 3}

    def rows(self, section, columns):
        return [row for row in self.tables.get(section, []) if len(row) == columns]


def write_report(bank, job, folder, *more, code=0):
    run = subprocess.run([BIN / "write_report", bank, job, folder, *map(str, more)], capture_output=True, text=True, timeout=280)
    assert run.returncode == code, (run.returncode, run.stderr)
    return run.stderr if code else Page(pathlib.Path(folder) / "report.html")


def write_edited(bank, change, out):
    """A copy of a bank with another content, sealed again as docs/bank-format.md says."""
    page = (SOURCE / "docs/bank-format.md").read_text()
    (sealer,) = [block for block in re.findall(r"```python\n(.*?)```", page, re.S) if block.startswith("# seal_bank.py ")]
    pathlib.Path(out).write_bytes(pathlib.Path(bank).read_bytes())
    with h5py.File(out, "r+") as file:
        change(file)
    kept, sys.argv = sys.argv, ["seal_bank.py", str(out)]
    try:
        exec(compile(sealer, "seal_bank.py", "exec"), {"__name__": "__main__"})
    finally:
        sys.argv = kept


def set_text(file, name, text):
    del file[name]
    file[name] = numpy.bytes_(text)
    file[name].attrs["units"], file[name].attrs["meaning"] = "1", "text"


def read_seconds(text):
    """What format_seconds wrote, and how far rounding may have moved it."""
    if match := re.fullmatch(r"([\d.]+) ms", text):
        return float(match[1]) / 1e3, 0.5e-3
    if match := re.fullmatch(r"([\d.]+) s", text):
        return float(match[1]), 0.5e-2
    minutes, seconds = re.fullmatch(r"(\d+) min (\d+) s", text).groups()
    return 60.0 * int(minutes) + int(seconds), 0.5


@unittest.skipUnless(os.path.exists(CHROMIUM), "there is no Chromium")
class Reports(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.browser = Browser()
        cls.addClassCleanup(cls.browser.close)
        Page.tab = cls.browser.open("about:blank")
        cls.temporary = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.temporary.name)
        fixtures.copy("bar.msh", cls.root, "chime.msh")
        cls.job = {
            "mesh": "chime.msh",
            "bank": "chime.hdf",
            "element": "T10",
            "band_hz": [20, 20000],
            "material": {
                "young_modulus_pa": 7e10,
                "poisson_ratio": 0.33,
                "density_kg_m3": 2700,
                "damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 2.0}},
            },
        }
        (cls.root / "job.json").write_text(json.dumps(cls.job))
        subprocess.run(
            ["mpirun", "-np", "2", "--oversubscribe", "--bind-to", "none", BIN / "carillon-precompute", "--profile", cls.root / "job.json"],
            check=True,
            capture_output=True,
            timeout=200,
        )
        cls.bank, cls.resolved = cls.root / "chime.hdf", cls.root / "chime.hdf.resolved.json"
        cls.record = json.loads(cls.resolved.read_text())
        cls.page = write_report(cls.bank, cls.resolved, cls.root / "report", NOTHING)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def report(self, name, record=None, bank=None, *more):
        """The report of a record that was changed; no pictures."""
        file = self.root / f"{name}.json"
        file.write_bytes(record if isinstance(record, bytes) else json.dumps(record).encode())
        return write_report(bank or self.bank, file, self.root / name, *(more or [NOTHING]))

    def assert_whole(self, page):
        """Nothing loads or runs, and every section has content or a reason for its absence."""
        self.assertEqual(page.tags & {"script", "iframe", "object", "embed", "link", "form", "base", "foreignObject"}, set())
        self.assertEqual([name for name in page.attributes if name.startswith("on") or name == "style"], [])
        for link in page.links:
            self.assertTrue(link.startswith("#") or link == "report-modes.png", link)
        self.assertEqual(list(page.missing), SECTIONS)
        for section, is_missing in page.missing.items():
            self.assertEqual("Left out: " in page.text[section] and len(page.tables.get(section, [])) == 0, is_missing, section)

    def test_every_section_is_there(self):
        self.assert_whole(self.page)
        self.assertEqual([name for name, is_missing in self.page.missing.items() if is_missing], ["pictures", "play"])
        self.assertEqual(self.page.title, "chime.msh")
        self.assertIn("carillon-draw is not installed here", self.page.text["pictures"])
        self.assertFalse((self.root / "report/report-modes.png").exists())

    def test_modes_are_those_of_the_bank(self):
        rows = self.page.rows("modes", 15)[1:]
        with h5py.File(self.bank) as bank:
            freq, decay = bank["modes/frequency_hz"][:], bank["modes/corrected_decay"][:]
            columns = {
                0: numpy.arange(1, len(freq) + 1),
                1: freq,
                2: bank["modes/algebraic_error_cents"][:],
                3: bank["modes/discretisation_error_cents"][:],
                4: bank["modes/corrected_frequency_hz"][:],
                5: bank["modes/corrected_error_cents"][:],
                7: decay,
                11: math.log(1000) / decay,
                12: bank["modes/residual"][:],
                13: bank["modes/radiation_gain"][:],
            }
            names = numpy.array(["one mesh", "two meshes", "rough", "too stiff", "lumped T10", "disputed"])[bank["modes/correction"][:]]
        self.assertGreater(len(freq), 10)
        self.assertEqual(len(rows), len(freq))
        self.assertEqual([row[6] for row in rows], list(names))
        info = json.loads(subprocess.run([BIN / "carillon-bank", "info", "--json", self.bank], capture_output=True, check=True).stdout)
        self.assertEqual([row[14] for row in rows], [mode["kind"] for mode in info["modes"]])
        self.assertIn("bending, 2 nodes", [row[14] for row in rows])
        for column, digits in zip(columns, [9, 6, 2, 2, 6, 2, 4, 3, 2, 4]):
            shown = numpy.array([float(row[column]) for row in rows])
            # Rounded to so many digits, and frequencies to a hundredth of a hertz.
            self.assertTrue(
                numpy.all(abs(shown - columns[column]) <= 0.51 * 10.0 ** (1 - digits) * abs(columns[column]) + 0.006 * (column in (1, 4))),
                column,
            )

    def test_charts_have_a_mark_for_each_mode_in_order(self):
        with h5py.File(self.bank) as bank:
            freq, residual = bank["modes/corrected_frequency_hz"][:], bank["modes/residual"][:]
            bars, heard_bars = bank["modes/discretisation_error_cents"][:], bank["modes/corrected_error_cents"][:]
        for section in ("modes", "residuals", "errors"):
            marks = [(float(a["cx"]), float(a["cy"]), title) for tag, a, title in self.page.charts[section] if tag == "circle"]
            marks = marks[: len(freq)]
            self.assertEqual(len(marks), len(freq), section)
            # Along a logarithmic axis.
            x = numpy.array([mark[0] for mark in marks])
            line = numpy.polyfit(numpy.log(freq), x, 1)
            self.assertLess(max(abs(numpy.polyval(line, numpy.log(freq)) - x)), 0.1, section)
            self.assertGreater(x[-1] - x[0], 600)
            for i, mark in enumerate(marks):
                self.assertIn(f"mode {i + 1}, {freq[i]:.2f} Hz", mark[2])
        for section, values in (("residuals", residual), ("errors", bars)):
            y = numpy.array([float(a["cy"]) for tag, a, _ in self.page.charts[section] if tag == "circle"])[: len(freq)]
            line = numpy.polyfit(numpy.log(values), y, 1)
            self.assertLess(line[0], 0)
            self.assertLess(max(abs(numpy.polyval(line, numpy.log(values)) - y)), 0.1, section)
        # Whiskers: error bars of the heard frequencies.
        (whiskers,) = [a["d"] for tag, a, _ in self.page.charts["modes"] if tag == "path" and a.get("class", "").startswith("bar")]
        ends = [tuple(map(float, ends)) for ends in re.findall(r"M([\d.]+) [\d.]+v6m0 -3H([\d.]+)", whiskers)]
        slope = (x[-1] - x[0]) / math.log(freq[-1] / freq[0])
        for i, (low, high) in enumerate(ends):
            self.assertAlmostEqual(high - low, 2 * heard_bars[i] * math.log(2) / 1200 * slope, delta=0.21)
        self.assertEqual(len(ends), len(freq))

    def test_the_proof_is_that_of_the_bank(self):
        rows = self.page.rows("proof", 5)[1:]
        with h5py.File(self.bank) as bank:
            cuts, below, freq = bank["proof/cut_hz"][:], bank["proof/below"][:], bank["modes/frequency_hz"][:]
            orthonormality, method = bank["proof/orthonormality"][()], bank["proof/method"][()].decode()
        self.assertEqual([int(row[1]) for row in rows], below.tolist())
        for row, cut in zip(rows, cuts):
            self.assertAlmostEqual(float(row[0]) / cut, 1.0, delta=1e-5)
        self.assertEqual([row[2] for row in rows[1:]], [str(n) for n in numpy.diff(below)])
        self.assertEqual([int(row[3]) for row in rows[1:]], numpy.histogram(freq, cuts)[0].tolist())
        facts = self.page.facts("proof")
        self.assertEqual(float(facts["worst orthonormality"][0]), float(f"{orthonormality:.1e}"))
        self.assertEqual(facts["method"][0], method)
        self.assertEqual(facts["rigid motions"][0], "6")
        self.assertIn("and no more: 6 below", self.page.text["head"])

    def test_mesh_time_memory_and_work_are_those_of_the_record(self):
        run = self.record["run"]
        facts = self.page.facts("mesh")
        self.assertEqual(facts["smallest dihedral angle"][0], f"{run['mesh']['min_dihedral_deg']:.2f}\u00b0")
        self.assertEqual(facts["worst mean ratio"][0], f"{run['mesh']['mean_ratio_min']:.4f}")
        self.assertEqual(facts["nodes"][0], f"{run['mesh']['nodes']:,}")
        self.assertEqual(facts["tetrahedra"][0], f"{run['mesh']['tets']:,}")
        self.assertEqual(facts["source"][0], run["mesh"]["source"])
        # The surface, which is measured for the report.
        with h5py.File(self.bank) as bank:
            corners = bank["mesh/vertices"][:][bank["mesh/triangles"][:]]
        sides = numpy.roll(corners, -1, axis=1) - corners
        lengths = numpy.linalg.norm(sides, axis=2)
        cosines = -numpy.einsum("tij,tij->ti", sides, numpy.roll(sides, -1, axis=1)) / (lengths * numpy.roll(lengths, -1, axis=1))
        angles = numpy.degrees(numpy.arccos(cosines)).min(axis=1)
        self.assertEqual(facts["smallest angle"][0], f"{angles.min():.2f}\u00b0")
        self.assertEqual(
            facts["edges"], [f"{1e3 * lengths.mean():.4g} mm on average", f"{1e3 * lengths.min():.4g} mm to {1e3 * lengths.max():.4g} mm"]
        )
        texts = [text for tag, _, text in self.page.charts["mesh"] if tag == "text"]
        # Right angles halved lie on an edge between bins or next to it, by rounding: bars and numpy may differ by those.
        at_edges = numpy.count_nonzero(abs(angles / 10 - numpy.round(angles / 10)) < 1e-6)
        for text, count in zip(texts[1::2], numpy.histogram(angles, numpy.arange(0, 70, 10))[0]):
            self.assertLessEqual(abs(int(text.split()[0].replace(",", "")) - count), at_edges)
        self.assertEqual(sum(int(text.split()[0].replace(",", "")) for text in texts[1::2]), len(angles))
        # Bars as long as their seconds, and words next to them.
        phases = run["phase_seconds"]
        texts = [text for tag, _, text in self.page.charts["time"] if tag == "text"]
        widths = [float(a["width"]) for tag, a, _ in self.page.charts["time"] if tag == "rect"]
        shown = dict(zip(texts[::2], zip(texts[1::2], widths)))
        self.assertEqual(set(shown), set(phases))
        longest = max(phases.values())
        for name, (text, width) in shown.items():
            seconds, rounding = read_seconds(text.split(" \u00b7 ")[0])
            self.assertAlmostEqual(seconds, phases[name], delta=rounding + 1e-9)
            self.assertAlmostEqual(width, max(1.0, 570.0 * phases[name] / longest), delta=0.01)
        rows = self.page.rows("time", 5)[1:]
        self.assertEqual([row[0] for row in rows], [phase["name"] for phase in run["stations"]])
        self.assertIn("on 2 ranks", self.page.text["time"])
        bars = [text for tag, _, text in self.page.charts["memory"] if tag == "text"]
        self.assertEqual(bars[::2], ["rank 0", "rank 1"])
        for text, size in zip(bars[1::2], run["peak_bytes_by_rank"]):
            self.assertEqual(text, f"{size / 1e6:.1f} MB")
        ranks = self.page.rows("memory", 4)[1:]
        self.assertEqual(
            [[int(cell.replace(",", "")) for cell in row[1:]] for row in ranks],
            [[rank["elements"], rank["owned_nodes"], rank["halo_nodes"]] for rank in run["partition"]["ranks"]],
        )
        self.assertEqual(int(self.page.facts("work")["solves"][0].replace(",", "")), run["solver"]["solves"])
        self.assertEqual({row[0] for row in self.page.rows("work", 6)[1:]}, set(run["work"]))

    def test_size_checks_and_job(self):
        size = self.bank.stat().st_size
        self.assertIn(f"{size:,} bytes", self.page.text["size"])
        with h5py.File(self.bank) as bank:
            shapes = 2 * bank["modes/shape"].size
        texts = [text for tag, _, text in self.page.charts["size"] if tag == "text"]
        self.assertTrue(texts[1].startswith(f"{shapes / 1e3:.1f} kB" if shapes < 1e6 else f"{shapes / 1e6:.1f} MB"), texts)
        said = subprocess.run([BIN / "carillon-bank", "check", self.bank], capture_output=True, text=True, check=True).stdout
        for row in self.page.rows("checks", 3)[1:]:
            self.assertEqual(row[0], "ok")
            self.assertRegex(said, rf"(?m)^ok +{re.escape(row[1])} +{re.escape(row[2])}$")
        shown = json.loads(self.page.text["job"].strip().removeprefix("Job"))
        self.assertEqual(shown, {key: value for key, value in self.record.items() if key != "run"})
        self.assertEqual(self.page.facts("program")["revision"][0], self.record["run"]["git"])

    def test_the_same_input_gives_the_same_bytes_and_nothing_else_is_left(self):
        again = write_report(self.bank, self.resolved, self.root / "again", NOTHING)
        self.assertEqual(again.source, self.page.source)
        once_more = write_report(self.bank, self.resolved, self.root / "again", NOTHING)  # over the earlier one
        self.assertEqual(once_more.source, self.page.source)
        self.assertEqual(os.listdir(self.root / "again"), ["report.html"])

    def test_hostile_names_are_text(self):
        names = [
            "<script>alert(1)</script>",
            '"><img src=x onerror=alert(1)>',
            "' onload='alert(1)",
            "</style></title><h1>",
            "&lt;b&gt; &amp;",
            "\u202etxt.exe",
            "\x1b[31mred\x00\x07",
            "\ufeff\u200b\u2066",
            "{} {0} %s %n",
            "</svg><script>x</script>",
            "]]>--><!--",
            "\U000e0041\ud7ff",
        ]
        record = json.loads(self.resolved.read_text())
        hostile = "".join(names)
        run = record["run"]
        record["mesh"] = hostile
        record["material"]["name"] = hostile
        run["mesh"]["source"] = run["git"] = run["program"] = run["finished_utc"] = run["solver"]["factorisation"] = run["solver"][
            "ordering"
        ] = hostile
        run["warnings"] = run["mesh"]["warnings"] = names
        run["versions"][hostile] = hostile
        run["phase_seconds"] = {name: 1.0 for name in names}
        run["work"] = {name: {"flops": 1} for name in names}
        run["stations"][0]["name"] = hostile
        bank = self.root / "evil.hdf"

        def spoil(file):
            set_text(file, "proof/method", hostile.replace("\x00", "").encode() + b"\xff\xfe<b>")

        write_edited(self.bank, spoil, bank)
        named = self.root / "<img src=x onerror=alert(1)>&\u202e.hdf"
        os.rename(bank, named)
        page = self.report("hostile", record, named)
        self.assert_whole(page)
        self.assertEqual(page.tags, self.page.tags | {"ul", "li"})
        self.assertEqual(page.attributes - self.page.attributes, set())
        for section in ("head", "proof", "mesh", "time", "work", "job", "program"):
            self.assertIn("<script>alert(1)</script>", page.text[section], section)
        for text in page.text.values():
            self.assertNotRegex(text, "[\x00-\x09\x0b-\x1f\x7f-\x9f\u200b-\u200f\u202a-\u202e\u2060-\u206f\ufeff\U000e0000-\U000e007f]")
        self.assertIn("\\u202etxt.exe", page.text["program"])
        self.assertIn("\\xff\\xfe<b>", page.text["proof"])
        self.assertIn("{} {0} %s %n", page.text["time"])
        title = write_report(self.bank, self.resolved, self.root / "titled", NOTHING, 6, 60, hostile.replace("\x00", ""))
        self.assert_whole(title)
        self.assertTrue(title.title.startswith(names[0] + names[1]))

    def test_a_record_without_a_part_leaves_its_section_out(self):
        for section, keys in {
            "time": ["phase_seconds", "stations"],
            "memory": ["peak_bytes_by_rank", "partition"],
            "work": ["work", "solver"],
            "program": ["program", "git", "finished_utc", "ranks", "versions"],
        }.items():
            record = json.loads(self.resolved.read_text())
            for key in keys:
                del record["run"][key]
            page = self.report(f"without-{section}", record)
            self.assert_whole(page)
            self.assertEqual({name for name, is_missing in page.missing.items() if is_missing}, {"pictures", "play", section})
            self.assertIn("of an older version, or damaged", page.text[section])

    def test_damaged_records_are_left_out_and_nothing_breaks(self):
        spoilt = [None, True, -1, 1e308, "x", [], {}, [[]], {"a": {"b": []}}, [None, {}, 5, "x"], 2**63, -1e-300, {"seconds": []}]
        for number, value in enumerate(spoilt):
            for key in self.record["run"]:
                record = json.loads(self.resolved.read_text())
                record["run"][key] = value
                self.assert_whole(self.report("spoilt", record))
            record = json.loads(self.resolved.read_text())
            for key in list(record["run"]):
                if isinstance(record["run"][key], dict):
                    record["run"][key] = {inner: value for inner in record["run"][key]}
                elif isinstance(record["run"][key], list):
                    record["run"][key] = [value] * 3
                else:
                    record["run"][key] = value
            self.assert_whole(self.report(f"spoilt-{number}", record))

    def test_the_banks_own_record_is_used_when_a_file_is_no_record(self):
        text = self.resolved.read_bytes()
        deep = b"[" * 100000
        for name, content in {
            "empty": b"",
            "cut": text[: len(text) // 2],
            "list": b"[1, 2]",
            "deep": deep,
            "bytes": bytes(range(256)),
            "twice": text + text,
        }.items():
            page = self.report(f"no-{name}", content)
            self.assert_whole(page)
            self.assertIn("The bank's own copy of the record is shown.", page.text["head"])
            self.assertFalse(page.missing["memory"])
        for name in ("absent.json", "."):
            page = write_report(self.bank, self.root / name, self.root / "absent", NOTHING)
            self.assertIn("The file of the resolved job cannot be read.", page.text["head"])
            self.assertFalse(page.missing["mesh"])
        pipe = self.root / "pipe"
        os.mkfifo(pipe)
        self.assertFalse(write_report(self.bank, pipe, self.root / "piped", NOTHING).missing["job"])
        job = {key: value for key, value in self.record.items() if key != "run"}
        page = self.report("only-job", {**job, "mesh": "other.msh"})
        self.assertEqual(page.title, "other.msh")
        self.assertFalse(page.missing["time"])

    def test_banks_of_version_1_0_have_neither_proof_nor_error_bars_nor_record(self):
        page = write_report(SOURCE / "tests/unit/runtime/bank/pinned/version_1_0.hdf", "", self.root / "first", NOTHING)
        self.assert_whole(page)
        for section in ("proof", "errors"):
            self.assertTrue(page.missing[section], section)
        self.assertIn("banks of version 1.0 carry none", page.text["proof"])
        self.assertIn("There is no proof that no mode is missing", page.text["head"])

    def test_many_modes_are_all_drawn(self):
        bank = self.root / "many.hdf"
        subprocess.run([BIN / "make_example_bank", bank, "2", "2500"], check=True)
        page = write_report(bank, "", self.root / "many", NOTHING)
        self.assert_whole(page)
        (dots,) = [a["d"] for tag, a, _ in page.charts["modes"] if tag == "path" and a.get("class", "").startswith("dots")]
        self.assertEqual(dots.count("h0"), 2500)
        self.assertEqual(len(page.rows("modes", 15)), 1001)
        self.assertIn("The first 1000 of 2500 modes", page.text["modes"])

    def test_modes_that_ring_for_ever_are_drawn_by_their_number(self):
        bank = self.root / "undamped.hdf"
        subprocess.run([BIN / "carillon-bank", "edit", self.bank, bank, "--alphas", "0", "0"], check=True, capture_output=True)
        page = write_report(bank, self.resolved, self.root / "undamped", NOTHING)
        self.assert_whole(page)
        y = numpy.array([float(a["cy"]) for tag, a, _ in page.charts["modes"] if tag == "circle"])
        steps = numpy.diff(y)
        self.assertTrue(len(y) > 10 and max(steps) < 0 and max(abs(steps - steps.mean())) < 0.11, steps)
        self.assertEqual({row[11] for row in page.rows("modes", 15)[1:]}, {"inf"})

    def test_a_bank_without_modes_has_a_report(self):
        bank = self.root / "mute.hdf"
        subprocess.run([BIN / "make_example_bank", bank, "2", "0"], check=True)
        page = write_report(bank, "", self.root / "mute")
        self.assert_whole(page)
        self.assertTrue(page.missing["modes"] and page.missing["pictures"])

    def test_a_bank_that_is_not_sane_is_reported_as_such(self):
        def spoil(file):
            values = file["modes/eigenvalue"][:]
            values[1], values[2], values[3] = math.nan, -5.0, math.inf
            file["modes/eigenvalue"][:] = values
            file["modes/decay"][0] = math.nan
            file["modes/residual"][4] = math.inf
            file["modes/discretisation_error_cents"][5] = 1e300
            file["mesh/vertices"][3] = [math.nan, 1e308, -math.inf]

        write_edited(self.bank, spoil, self.root / "insane.hdf")
        page = write_report(self.root / "insane.hdf", self.resolved, self.root / "insane", NOTHING)
        self.assert_whole(page)
        self.assertIn("This bank is invalid", page.text["head"])
        self.assertIn("FAULT", [row[0] for row in page.rows("checks", 3)])
        self.assertIn("without a place on these axes", page.text["modes"])

    def test_what_is_no_bank_has_none(self):
        bad = self.root / "bad.hdf"
        bad.write_bytes(self.bank.read_bytes()[:-100])
        self.assertIn("bad.hdf", write_report(bad, self.resolved, self.root / "bad", code=2))
        self.assertFalse((self.root / "bad").exists())
        self.assertIn("nowhere.hdf", write_report(self.root / "nowhere.hdf", self.resolved, self.root / "bad", code=2))
        (self.root / "taken").write_text("a file")
        self.assertIn("taken", write_report(self.bank, self.resolved, self.root / "taken", code=4))
        self.assertEqual((self.root / "taken").read_text(), "a file")

    def test_pictures_are_drawn(self):
        page = write_report(self.bank, self.resolved, self.root / "drawn")
        self.assert_whole(page)
        if page.missing["pictures"]:  # a machine without VTK: the reason is that of carillon-draw
            self.assertIn("carillon-draw: ", page.text["pictures"])
            self.skipTest(page.text["pictures"])
        self.assertIn("report-modes.png", page.links)
        data = (self.root / "drawn/report-modes.png").read_bytes()
        self.assertEqual(data[:8], b"\x89PNG\r\n\x1a\n")
        width, height = struct.unpack(">II", data[16:24])
        self.assertGreater(min(width, height), 500)
        # Without the program the picture of the earlier report goes, too.
        self.assertEqual(write_report(self.bank, self.resolved, self.root / "drawn", NOTHING).source, self.page.source)
        self.assertEqual(os.listdir(self.root / "drawn"), ["report.html"])

    def test_a_program_that_does_not_draw_is_quoted(self):
        def draw(name, script, *more):
            program = self.root / f"{name}.sh"
            program.write_text("#!/bin/sh\n" + script)
            program.chmod(0o755)
            page = write_report(self.bank, self.resolved, self.root / f"with-{name}", program, *more)
            self.assert_whole(page)
            self.assertTrue(page.missing["pictures"])
            self.assertEqual(os.listdir(self.root / f"with-{name}"), ["report.html"])
            return page.text["pictures"]

        result = '{"kind": "system", "message": "no <display>", "resumable": false}'
        self.assertIn("carillon-draw: no <display>", draw("fails", f"echo '{result}' > \"$8\"\nexit 4\n"))
        self.assertIn("exit code 7", draw("mute", "exit 7\n"))
        self.assertIn("signal 9", draw("dies", "kill -9 $$\n"))
        self.assertIn("left no picture", draw("idle", "exit 0\n"))
        self.assertIn("left no picture", draw("half", "printf '\\211PNG\\r\\n\\032\\n' > \"$4\"\n"))
        draw("untidy", 'touch "$(dirname "$4")/.left.png"; exit 1\n')
        self.assertIn(
            "took longer than 0.3 s and was ended",
            draw("slow", f"echo $$ > '{self.root}/slow.pid'\necho x > \"$4\"\nexec sleep 60\n", 6, 0.3),
        )
        self.assertFalse(pathlib.Path(f"/proc/{(self.root / 'slow.pid').read_text().strip()}").exists())
        # What it is given: the path of the bank whole, whatever is in it, and no more modes than a picture takes.
        said = draw("asked", f"printf '%s\\n' \"$@\" > '{self.root}/asked.txt'\nexit 1\n", 1000)
        self.assertIn("exit code 1", said)
        words = (self.root / "asked.txt").read_text().splitlines()
        self.assertEqual(words[:3] + words[4:7], ["modes", str(self.bank), "-o", "--modes", "1,2,3,4,5,6,7,8,9,10,11,12", "--result"])
        self.assertTrue(words[3].startswith(str(self.root / "with-asked")) and words[3].endswith("/report-modes.png"), words[3])

    def test_the_store_keeps_a_report_next_to_each_bank(self):
        def carillon(*words, code=0):
            run = subprocess.run([BIN / "carillon", "--store", self.root / "store", *words], capture_output=True, text=True, timeout=250)
            self.assertEqual(run.returncode, code, run.stderr)
            return run.stdout + run.stderr if code else run.stdout

        job = self.root / "kept.json"
        job.write_text(json.dumps({**self.job, "element": "T4", "max_modes": 3}))
        self.assertIn("no report yet", carillon("report", job, code=1))
        carillon("submit", job)
        carillon("run", "-q")
        file = pathlib.Path(carillon("report", job, "--no-pictures").strip())
        self.assertEqual(
            json.loads(carillon("--json", "report", job, "--no-pictures")), {"id": file.parent.name, "state": "done", "report": str(file)}
        )
        bank = pathlib.Path(carillon("get", job).strip())
        self.assertEqual(file, bank.parent / "report.html")
        self.assertEqual(stat.S_IMODE(file.stat().st_mode), 0o444)
        page = Page(file)
        self.assert_whole(page)
        # The name that the user knows, not that of the snapshot; and all of the record.
        self.assertEqual(page.title, "chime.msh")
        self.assertEqual([name for name, is_missing in page.missing.items() if is_missing], ["pictures", "play"])
        self.assertEqual(len(page.rows("modes", 15)), 4)
        carillon("report", job, "-o", self.root / "made", "--no-pictures", "--no-page")
        self.assertEqual((self.root / "made/report.html").read_bytes(), page.source)
        # Who asks for it first has it drawn, next to the bank and for all who ask later. The records there stay what was published.
        picture = bank.parent / "report-modes.png"
        self.assertFalse(picture.exists())
        self.assertEqual(carillon("report", job).strip(), str(file))
        drawn = Page(file)
        if not drawn.missing["pictures"]:
            self.assertTrue(picture.read_bytes().startswith(b"\x89PNG"))
            before = picture.stat().st_mtime_ns
            carillon("report", job)
            self.assertEqual(picture.stat().st_mtime_ns, before)
        self.assertEqual([stat.S_IMODE(path.stat().st_mode) for path in (file, bank.parent)], [0o444, 0o555])
        carillon("verify")
        # Of any bank, with its record next to it.
        said = carillon("report", self.bank, "-o", self.root / "of file", "--no-pictures")
        self.assertEqual(said.strip(), str(self.root / "of file/report.html"))
        self.assertFalse(Page(said.strip()).missing["time"])
        # With the page to play it, where the page is installed.
        has_page = all((BIN.parent / "share/carillon" / part).is_dir() for part in ("explore", "web"))
        self.assertEqual(Page(said.strip()).missing["play"], not has_page)
        self.assertEqual((self.root / "of file/explore/index.html").exists(), has_page)
        self.assertIn("-o", carillon("report", self.bank, code=2))
        self.assertIn("not a Carillon bank", carillon("report", self.root / "chime.msh", "-o", self.root / "none", code=2))
        self.assertFalse((self.root / "none").exists())

    def test_every_screen_holds_the_report(self):
        record = json.loads(self.resolved.read_text())
        record["run"]["warnings"] = ["a warning without a space: " + 200 * "x"]
        self.report("wide", record)
        with serve(self.root) as server:
            page = self.browser.open(f"{server.url}wide/report.html")
            page.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
            for width in (320, 390, 768, 1280):
                page.resize(width, 800)
                self.assertLessEqual(page.evaluate("document.documentElement.scrollWidth"), width)
                # Wide content scrolls inside its box; nothing else exceeds the edge.
                out = page.evaluate(
                    "[...document.querySelectorAll('body *')].filter(it => !it.closest('.table, .chart, pre') &&"
                    " it.getBoundingClientRect().right > innerWidth + 0.5).map(it => it.outerHTML.slice(0, 80))"
                )
                self.assertEqual(out, [], width)

    def test_no_pictures_when_none_are_asked_for(self):
        page = write_report(self.bank, self.resolved, self.root / "unasked", "", 0)
        self.assertIn("not drawn yet", page.text["pictures"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
