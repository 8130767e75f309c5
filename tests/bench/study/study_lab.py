"""The lab of the accuracy study: commands that repeat a section, and the machine it ran on."""
import os
import shlex
import time

from lab import Lab

# Nodes asked for, coarse to fine: all, and with --quick. Thin walls need more, those of T10 again more.
SIZES, QUICK_SIZES = (400, 1000, 2500, 6000, 15000), (300, 900, 2700)
THIN = ((800, 2000, 5000, 12000, 30000), (500, 1300, 3200))
SIZES_OF = {"tube": THIN, "bowl": THIN, "bunny": ((6000, 10500, 18000, 32000, 60000), (3000, 5000, 9000))}
QUADRATIC_SIZES_OF = {"bunny": ((18500, 27000, 40000, 64000, 105000), (18500, 21000, 24000))}


class StudyLab(Lab):
    def __init__(self, options, programs):
        """options: of tests/bench/study/run. programs: {name: path}."""
        super().__init__(options.out, programs, options.quick, options.repeats, options.surface, options.timeout)
        self.on, self.asked_repeats = options.on, options.repeats
        self.start, self.load_start = time.monotonic(), os.getloadavg()[0]
        self.found = {}  # results by section, for later sections

    def get_sizes(self, body, kind):
        sizes = SIZES_OF.get(body.name, (SIZES, QUICK_SIZES))
        return (QUADRATIC_SIZES_OF.get(body.name, sizes) if kind.element == "T10" else sizes)[self.quick]

    def make_command(self, section, *words):
        """The command that repeats a section or a part of it."""
        on = ["--on", *self.on] if self.on and "--on" not in words else []
        repeats = ["--repeats", str(self.asked_repeats)] if self.asked_repeats else []
        return shlex.join(
            ["tests/bench/study/run", "--only", section, *words, *on, *repeats, *(["--quick"] if self.quick else []), "-o", "REPORT"]
        )

    def describe_machine(self):
        processors = [line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")][:1]
        cores = len(os.sched_getaffinity(0))
        others = max(self.load_start, 0.0)
        return (
            f"{processors[0] if processors else 'A processor without a name'}, {cores} core{'s' if cores > 1 else ''}; load of the machine"
            f" when the study began {others:.1f}, at its end {os.getloadavg()[0]:.1f}. This call ran solves of {self.measured_s:.0f} CPU s"
            f" in {(time.monotonic() - self.start) / 60:.1f} minutes; {self.repeats} repeat{'s' if self.repeats > 1 else ''} of every case,"
            " all cases in turn, medians of CPU seconds (user and system, all processes)."
        )
