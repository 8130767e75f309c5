#!/usr/bin/python3
"""carillon-bank export to Faust, from outside: the program is compiled by Faust and a C++ compiler, runs, and sounds as carillon-render
does. Its hard cases are tests/hard/formats.py.

Finds the programs in $CARILLON_BIN_DIR.
"""
import pathlib
import re
import tempfile
import unittest

import h5py
import numpy

from banks import BIN, calc_db, fixtures, render_blow, run, take_modes

# Writes what `struck` answers to a blow in the first sample, as doubles. FAUSTFLOAT is the type of samples outside.
MAIN = """
#define FAUSTFLOAT double
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <string>
#include <vector>
#include "faust/gui/meta.h"
#include "faust/gui/UI.h"
#include "faust/dsp/dsp.h"
using std::max;
using std::min;
#include "body.cpp"
struct Knobs : UI {
  std::map<std::string, double*> zone;
  void add(const char* label, double* z) { zone[label] = z; }
  void openTabBox(const char*) override {}
  void openHorizontalBox(const char*) override {}
  void openVerticalBox(const char*) override {}
  void closeBox() override {}
  void addButton(const char* l, double* z) override { add(l, z); }
  void addCheckButton(const char* l, double* z) override { add(l, z); }
  void addVerticalSlider(const char* l, double* z, double, double, double, double) override { add(l, z); }
  void addHorizontalSlider(const char* l, double* z, double, double, double, double) override { add(l, z); }
  void addNumEntry(const char* l, double* z, double, double, double, double) override { add(l, z); }
  void addHorizontalBargraph(const char*, double*, double, double) override {}
  void addVerticalBargraph(const char*, double*, double, double) override {}
  void addSoundfile(const char*, const char*, Soundfile**) override {}
};
int main(int, char** argv) {
  const int rate = std::atoi(argv[1]), frames = std::atoi(argv[2]);
  const double impulse = std::atof(argv[3]);
  body dsp;
  dsp.init(rate);
  Knobs knobs;
  dsp.buildUserInterface(&knobs);
  for (auto& [label, zone] : knobs.zone) {
    if (label == "point" || label == "[1] point") *zone = std::atof(argv[4]);
    if (label == "strike" || label == "[0] strike") *zone = 1.0;
  }
  std::vector<double> in(frames, 0.0), out(frames, 0.0);
  in[0] = impulse;
  const std::clock_t begin = std::clock();
  for (int at = 0; at < frames; at += 256) {
    double *from = in.data() + at, *to = out.data() + at;
    dsp.compute(std::min(256, frames - at), &from, &to);
  }
  std::fprintf(stderr, "%.6f\\n", double(std::clock() - begin) / CLOCKS_PER_SEC);
  std::fwrite(out.data(), sizeof(double), out.size(), stdout);
}
"""


def compile_dsp(folder, dsp, precision="-double", entry="struck", level="-O1"):
    run("faust", "-t", "0", "-lang", "cpp", precision, "-cn", "body", "-pn", entry, dsp, "-o", "body.cpp", cwd=folder)
    (folder / "main.cpp").write_text(MAIN)
    run("g++", level, "-w", "main.cpp", "-o", "play", cwd=folder)


def play(folder, rate, frames, impulse, point=0):
    import subprocess

    done = subprocess.run([folder / "play", str(rate), str(frames), repr(impulse), str(point)], capture_output=True, timeout=300)
    assert done.returncode == 0
    return numpy.frombuffer(done.stdout, "<f8")


def read_points(dsp):
    return [list(map(float, line)) for line in re.findall(r"^// point \d+: (\S+), (\S+), (\S+) m$", dsp.read_text(), re.M)]


class FaustTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def compare(self, bank, dsp, point, rate, seconds=0.5):
        """Decibels of the difference between Faust and carillon-render, of a blow on the upper side of a plate."""
        with h5py.File(bank) as file:
            centre = file["rigid/centre_m"][:]
        where = read_points(self.folder / dsp)[point]
        ours = render_blow(self.folder, bank, where, (0, 0, -1e-4 if where[2] > centre[2] else 1e-4), centre, seconds, rate)
        theirs = play(self.folder, rate, len(ours), 1e-4, point)
        self.assertGreater(abs(ours).max(), 1e-6)
        return calc_db(theirs - ours, ours)

    def test_every_point_sounds_as_in_a_scene(self):
        bank = fixtures.get("aluminium_bar.hdf")
        out = run(
            BIN / "carillon-bank", "export", bank, "-o", "bar.dsp", "--points", "0.1,0.01,0.004", "0.29,0.03,0.004", cwd=self.folder
        ).stdout
        self.assertRegex(out, r"^faust +(\d+) of \1 modes\n")
        compile_dsp(self.folder, "bar.dsp")
        for point in (0, 1):
            self.assertLess(self.compare(bank, "bar.dsp", point, 48000), -100)

    def test_the_instrument_plays_a_blow_of_the_impulse_that_it_says(self):
        bank = take_modes(self.folder, "glass_plate.hdf", 1)
        run(BIN / "carillon-bank", "export", bank, "-o", "low.dsp", "--points", "1", cwd=self.folder)
        # Its own hammer into a filter that adds up: the impulse, 0.01 N s.
        text = (self.folder / "low.dsp").read_text().split("process =")[0] + "process = hammer : + ~ _;\n"
        (self.folder / "sum.dsp").write_text(text.replace("struck = body(point);", "struck = _;"))
        run("faust", "-lang", "cpp", "-double", "-cn", "body", "sum.dsp", "-o", "body.cpp", cwd=self.folder)
        (self.folder / "main.cpp").write_text(
            MAIN.replace("dsp.compute(std::min(256, frames - at), &from, &to)", "dsp.compute(std::min(256, frames - at), nullptr, &to)")
        )
        run("g++", "-O1", "-w", "main.cpp", "-o", "play", cwd=self.folder)
        heard = play(self.folder, 48000, 2400, 0.0)
        self.assertAlmostEqual(heard[-1], 0.01, 5)
        self.assertEqual(heard[30], heard[-1])  # 0.5 ms are 24 samples
        self.assertLess(heard[10], 0.006)

    def test_mistakes_end_in_a_sentence(self):
        bank = fixtures.get("glass_plate.hdf")
        for words, said in (
            (["--points", "1,2"], "give X,Y,Z in metres"),
            (["--points", "0"], "give 1 to 64"),
            (["--modes", "0"], "--modes"),
            (["--up", "z"], "--up is for GLB"),
        ):
            done = run(BIN / "carillon-bank", "export", bank, "-o", "x.dsp", *words, cwd=self.folder, code=2)
            self.assertIn(said, done.stderr)
            self.assertFalse((self.folder / "x.dsp").exists())


if __name__ == "__main__":
    unittest.main()
