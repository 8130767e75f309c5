#!/usr/bin/env python3
"""Table of an engine's sound against our own contact: all scenes and steps.

usage: survey.py PROGRAMS ENGINE [SCENE...] [--hz HZ...] [--banks FOLDER]     folder with the banks (box.h5, ...); solved if missing
"""
import argparse
import pathlib
import tempfile

import scenes


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("engine")
    parser.add_argument("scenes", nargs="*", default=list(scenes.SCENES))
    parser.add_argument("--hz", type=int, nargs="*", default=[60, 240, 1000])
    parser.add_argument("--banks", type=pathlib.Path)
    options = parser.parse_args()
    programs = options.programs.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        if options.banks:
            for kind in scenes.BANKS:
                (folder / f"{kind}.h5").symlink_to(options.banks.resolve() / f"{kind}.h5")
        else:
            scenes.solve_banks(programs, folder)
        for scene in options.scenes or list(scenes.SCENES):
            own = scenes.render_own(programs, folder, scene)
            print(f"{scene:5}  own   {' '.join(f'{x:4.0f}' for x in scenes.calc_levels(own[0]))}")
            for hz in options.hz:
                r = scenes.compare(programs, folder, options.engine, scene, hz, own)
                print(f"{'':5} {hz:5}  {' '.join(f'{x:4.0f}' for x in r['levels'])}")
                print(
                    f"{'':12} first hit {r['first_db']:+.1f} dB, centroid {r['centroid_percent']:+.1f} %,"
                    f" windows {r['windows_db']:.1f} dB,"
                    f" quiet ones {r['quiet_db']:.1f} dB, at the end {r['end_db']:.0f} dB(A); {r['hits']} hits, {r['touches']} contacts,"
                    f" {r['bad_points']} bad points, latest {1e3 * r['latest_s']:.1f} ms,"
                    f" {r['cpu_s'] / scenes.SCENES[scene][0]:.4f} CPU s/s"
                )


if __name__ == "__main__":
    main()
