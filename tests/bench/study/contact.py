"""Section: physics settings against closed-form motions: contact step, triangles of a body, impacts with and without modes; and the
penetration of falling discs by step."""
import json
import math

import measuring
import banks
import plots
import sounds
from section import Section
from sounds import np

NAME, TITLE = "contact", "Contact: what the knobs of the physics cost and buy"
PROGRAMS = banks.PROGRAMS
STEPS = (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3)
USUAL_STEP_S = 2.5e-4
NODES = (150, 400, 1000, 3000, 8000)
QUICK_NODES = (150, 1000)
USUAL_NODES = 1000
GRAVITY = 9.81
ROLLING_RESISTANCE = 1e-3  # hard on hard, docs/decisions/contact.md
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7800, "damping": {"internal_friction": {"tan_phi": 4e-4}}}
TOP = {
    "body": {"shape": "cone", "radius_m": 0.04, "height_m": 0.04, "nodes": 1500},
    "element": "T10",
    "band_hz": [20, 30000],
    "material": STEEL,
}
BALL = {"body": {"shape": "sphere", "radius_m": 0.03}, "element": "T10", "band_hz": [20, 60000], "material": STEEL}
PLATE = {
    "body": {"shape": "plate", "length_m": 0.2, "width_m": 0.2, "thickness_m": 0.002, "nodes": 3000},
    "element": "T10",
    "band_hz": [20, 6000],
    "material": STEEL,
}
DISC = {
    "body": {"shape": "disc", "radius_m": 0.0375, "thickness_m": 0.006, "nodes": 1500},
    "element": "T10",
    "band_hz": [20, 20000],
    "material": STEEL,
}
DISC_TILTS_DEG = (0.2, 1, 3, 8, 20, 45, 70, 89)  # thin bodies landing nearly flat penetrate deepest
QUICK_TILTS_DEG = (0.2, 20)
LEAN, SPIN_RAD_S = 0.2, 200.0
SLOPE = 0.05  # rad
HEAD = ("error of the motion", "CPU of the physics, ms for 1 s", "spread")
DATA = ("error", "cpu_ms_per_s", "spread")


def run(lab, scenes, repeats=None):
    """{name: (report, poses of the first body, [CPU ms per second])}; rounds alternate in direction to even out other load."""
    folder = lab.out / "work/contact"
    folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for number in range(repeats or lab.repeats):
        for name in list(scenes) if number % 2 == 0 else reversed(list(scenes)):
            (folder / f"{name}.scene.json").write_text(json.dumps(scenes[name], indent=1) + "\n")
            lab.call(
                [
                    lab.find_program("carillon-render"),
                    f"{name}.scene.json",
                    "-q",
                    "--audit",
                    "-o",
                    f"{name}.wav",
                    "--report",
                    f"{name}.report.json",
                    "--trajectory",
                    f"{name}.path.json",
                ],
                f"carillon-render {name}",
                cwd=folder,
            )
            report = json.loads((folder / f"{name}.report.json").read_text())
            poses = np.array(json.loads((folder / f"{name}.path.json").read_text())["bodies"][0]["poses"])
            found.setdefault(name, (report, poses, []))[2].append(1e3 * report["physics_cpu_s"] / report["duration_s"])
            (folder / f"{name}.wav").unlink(missing_ok=True)
    return found


def make_scene(seconds, body, ground, step_s=USUAL_STEP_S, **more):
    return {
        "duration_s": seconds,
        "ground": ground,
        "bodies": [body],
        "microphones": [[0.0, -1.0, 0.3]],
        "effects": ["modal"],
        "quality": {"contact_step_s": step_s},
    } | more


# --- spinning top


def find_top(bank):
    """(tip in mesh coordinates, distance from tip to centre of mass, axial inertia, transverse inertia about the tip, mass) of a cone
    along z."""
    arrays = sounds.read_arrays(bank, {"mesh/vertices", "rigid/centre_m", "rigid/inertia_kg_m2", "rigid/mass_kg"})
    vertices, centre, inertia = arrays["mesh/vertices"], arrays["rigid/centre_m"].reshape(3), arrays["rigid/inertia_kg_m2"].reshape(3, 3)
    mass = float(arrays["rigid/mass_kg"].reshape(-1)[0])
    width = {z: np.hypot(*vertices[vertices[:, 2] == z][:, :2].T).max() for z in (vertices[:, 2].min(), vertices[:, 2].max())}
    tip = np.array([0.0, 0.0, min(width, key=width.get)])
    arm = abs(centre[2] - tip[2])
    return tip, arm, inertia[2, 2], 0.5 * (inertia[0, 0] + inertia[1, 1]) + mass * arm * arm, mass


def calc_precession(arm, along, across, mass):
    """Rate of the slower steady precession: along s W - across W^2 cos a = m g l."""
    c = across * math.cos(LEAN)
    return (along * SPIN_RAD_S - math.sqrt((along * SPIN_RAD_S) ** 2 - 4 * c * mass * GRAVITY * arm)) / (2 * c)


def make_top(bank, step_s, seconds=1.0):
    tip, arm, along, across, mass = find_top(bank)
    precession = calc_precession(arm, along, across, mass)
    turn = LEAN if tip[2] < 0 else LEAN + math.pi
    at = tip[2] * np.array([math.sin(turn), 0.0, math.cos(turn)])
    axis = np.array([math.sin(LEAN), 0.0, math.cos(LEAN)])
    spin = (SPIN_RAD_S - precession * math.cos(LEAN)) * axis + np.array([0.0, 0.0, precession])
    body = {
        "name": "top",
        "bank": str(bank),
        "position_m": list(map(float, -at)),
        "rotation_deg": [0, math.degrees(turn), 0],
        "friction": 2.0,
        "velocity_m_s": [0, precession * arm * math.sin(LEAN), 0],
        "angular_velocity_rad_s": list(map(float, spin)),
    }
    return make_scene(seconds, body, {"friction": 2.0}, step_s)


def calc_top_error(bank, poses):
    """Relative error of the precession angle."""
    _, arm, along, across, mass = find_top(bank)
    w, x, y, z = poses[:, 4:8].T
    angle = np.unwrap(np.arctan2(2 * (y * z - w * x), 2 * (x * z + w * y)))
    return abs((angle[-1] - angle[0]) / (calc_precession(arm, along, across, mass) * (poses[-1, 0] - poses[0, 0])) - 1)


# --- rolling ball


def make_roll(bank, step_s=USUAL_STEP_S, seconds=1.0):
    radius = float(np.abs(sounds.read_arrays(bank, {"mesh/vertices"})["mesh/vertices"]).max())
    body = {
        "name": "ball",
        "bank": str(bank),
        "position_m": [0, 0, radius],
        "rotation_deg": [17, 31, 5],
        "friction": 0.5,
        "velocity_m_s": [0.2, 0, 0],
        "angular_velocity_rad_s": [0, 0.2 / radius, 0],
    }
    return make_scene(seconds, body, {"friction": 0.5}, step_s, gravity_m_s2=[GRAVITY * math.sin(SLOPE), 0, -GRAVITY * math.cos(SLOPE)])


def calc_roll_error(poses):
    """Relative error of the distance, 5/7 (g sin a - c g cos a) t^2 / 2 plus that of the initial speed."""
    seconds = poses[-1, 0]
    way = 0.2 * seconds + 0.5 * 5 / 7 * GRAVITY * (math.sin(SLOPE) - ROLLING_RESISTANCE * math.cos(SLOPE)) * seconds**2
    return abs((poses[-1, 1] - poses[0, 1]) / way - 1)


# --- falling discs


def make_discs(bank, step_s, tilts_deg, seconds=2.0):
    """Rigid discs a metre apart, each an island of its own."""
    bodies = [
        {
            "name": f"disc {n}",
            "bank": str(bank),
            "position_m": [float(n), 0, 0.1],
            "rotation_deg": [tilt, 0, 37.0 * n],
            "velocity_m_s": [0.1, 0, 0],
            "friction": 0.3,
            "restitution": 0.5,
        }
        for n, tilt in enumerate(tilts_deg)
    ]
    scene = make_scene(seconds, bodies[0], {"friction": 0.3}, step_s)
    scene["quality"]["modes_in_impacts"] = False
    return scene | {"bodies": bodies}


def list_depths(found, steps):
    """(setting, default?, maximum depth, final depth [um], [CPU ms per body])"""
    return [
        (
            f"{step:g}",
            step == USUAL_STEP_S,
            *(1e6 * report["depth_and_hits"][name]["depth_m"] for name in ("deepest", "deepest_now")),
            [cpu / report["bodies"] for cpu in cpus],
        )
        for step, (report, _, cpus) in zip(steps, (found[f"discs-{n}"] for n in range(len(steps))))
    ]


# --- words and tables


def add_table(section, name, rows, caption):
    """rows: (setting, default?, error, [CPU ms])"""
    section.add_table(
        name,
        [
            (name, *HEAD),
            *(
                (
                    setting + (" (default)" if usual else ""),
                    f"{error:.2g}",
                    f"{measuring.find_median(cpu):.1f}",
                    f"{100 * sounds.find_spread(cpu):.0f} %",
                )
                for setting, usual, error, cpu in rows
            ),
        ],
        caption,
        [
            (name, *DATA),
            *(
                (setting, float(error), float(measuring.find_median(cpu)), float(sounds.find_spread(cpu)))
                for setting, _, error, cpu in rows
            ),
        ],
    )


def describe(what, rows):
    best, usual = min(rows, key=lambda row: row[2]), next(row for row in rows if row[1])
    return (
        f"{what}: the default, {usual[0]}, is {100 * usual[2]:.2g} % off and takes {measuring.find_median(usual[3]):.1f} ms of the physics"
        f" for a second; the most accurate, {best[0]}, is {100 * best[2]:.2g} % off and takes {measuring.find_median(best[3]):.1f} ms."
    )


def to_points(rows):
    return [(measuring.find_median(cpu), error) for _, _, error, cpu in rows if error > 0]


def study(lab, bodies):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    steps = (STEPS[0], USUAL_STEP_S, STEPS[-1]) if lab.quick else STEPS
    nodes = QUICK_NODES if lab.quick else NODES
    jobs = {"top": TOP, "plate": PLATE, "disc": DISC} | {
        f"ball {count}": BALL | {"body": BALL["body"] | {"nodes": count}} for count in nodes
    }
    paths = banks.solve(lab, [banks.Sounding(name, name, job) for name, job in jobs.items()])
    section.say(
        f"A top of steel on its tip leans by {LEAN:g} rad and spins at {SPIN_RAD_S:g} rad/s for a second: its precession has a closed form."
        f" A ball of steel rolls down {SLOPE:g} rad for a second: its way is that of 5/7 of gravity along the slope, less the rolling"
        " resistance. A steel plate of 2 mm falls."
    )
    scenes = {f"top-{n}": make_top(paths["top"], step) for n, step in enumerate(steps)} | {
        f"roll-{n}": make_roll(paths[f"ball {USUAL_NODES}"], step) for n, step in enumerate(steps)
    }
    scenes |= {f"nodes-{count}": make_roll(paths[f"ball {count}"]) for count in nodes}
    tilts = QUICK_TILTS_DEG if lab.quick else DISC_TILTS_DEG
    scenes |= {f"discs-{n}": make_discs(paths["disc"], step, tilts) for n, step in enumerate(steps)}
    falls = {
        name: make_scene(1.0, {"name": "plate", "bank": str(paths["plate"]), "position_m": [0, 0, 0.3], "rotation_deg": [20, 15, 0]}, {})
        for name in ("with modes", "without")
    }
    falls["without"]["quality"]["modes_in_impacts"] = False
    found = run(lab, scenes | {f"fall-{name.replace(' ', '-')}": scene for name, scene in falls.items()})

    top = [
        (f"{step:g}", step == USUAL_STEP_S, calc_top_error(paths["top"], found[f"top-{n}"][1]), found[f"top-{n}"][2])
        for n, step in enumerate(steps)
    ]
    roll = [
        (f"{step:g}", step == USUAL_STEP_S, calc_roll_error(found[f"roll-{n}"][1]), found[f"roll-{n}"][2]) for n, step in enumerate(steps)
    ]
    add_table(section, "contact_step_s", top, "The longest step of bodies that touch. The top: error of its precession, relative.")
    section.conclude(describe("Step of contacts (`contact_step_s`), precession of a top", top))
    add_table(
        section,
        "contact_step_s_ball",
        roll,
        "The same for the ball: error of its way, relative; what does not fall with the step is the shape of the ball.",
    )
    section.conclude(describe("Step of contacts (`contact_step_s`), way of a ball that rolls", roll))

    discs = list_depths(found, steps)
    section.add_table(
        "contact_step_s_depth",
        [
            ("contact_step_s", "deepest, um", "at the end, um", "CPU of the physics, ms a body for 1 s", "spread"),
            *(
                (
                    setting + (" (default)" if usual else ""),
                    f"{ever:.1f}",
                    f"{last:.1f}",
                    f"{measuring.find_median(cpu):.1f}",
                    f"{100 * sounds.find_spread(cpu):.0f} %",
                )
                for setting, usual, ever, last, cpu in discs
            ),
        ],
        f"Depth in the ground of {len(tilts)} rigid steel discs of 75 x 6 mm that fall 0.1 m at tilts of {tilts[0]:g} to {tilts[-1]:g}"
        " degrees, 2 s: thin bodies take shorter steps of their own.",
    )
    usual_depth = next(row for row in discs if row[1])
    section.conclude(
        f"Step of contacts (`contact_step_s`), depth of falling discs: {usual_depth[2]:.0f} um at most with the default, {usual_depth[0]},"
        f" in {measuring.find_median(usual_depth[4]):.1f} ms of the physics a body for a second; {discs[0][2]:.0f} um with {discs[0][0]},"
        f" in {measuring.find_median(discs[0][4]):.1f} ms; {discs[-1][2]:.0f} um with {discs[-1][0]}, in"
        f" {measuring.find_median(discs[-1][4]):.1f} ms."
    )

    triangles = {count: len(sounds.read_arrays(paths[f"ball {count}"], {"mesh/triangles"})["mesh/triangles"]) for count in nodes}
    shape = [
        (f"{triangles[count]}", count == USUAL_NODES, calc_roll_error(found[f"nodes-{count}"][1]), found[f"nodes-{count}"][2])
        for count in nodes
    ]
    add_table(
        section,
        "triangles",
        shape,
        (
            "Collision geometry: the triangles that the ball's bank has, by the nodes of its job; error of its way, relative. There is no"
            " other key: search and skin are made from these triangles."
        ),
    )
    section.conclude(describe("Collision geometry, triangles of a ball that rolls", shape))

    (whole, _, whole_cpu), (rigid, _, rigid_cpu) = found["fall-with-modes"], found["fall-without"]
    energy = whole["energy"]
    section.add_table(
        "modes_in_impacts",
        [
            ("modes_in_impacts", "loudest 125 ms, dB", "CPU of the physics, ms for 1 s"),
            ("true (default)", f"{whole['loudest_db_spl']:.1f}", f"{measuring.find_median(whole_cpu):.1f}"),
            ("false", f"{rigid['loudest_db_spl']:.1f}", f"{measuring.find_median(rigid_cpu):.1f}"),
        ],
        "A steel plate of 200 x 200 x 2 mm falls 0.3 m: impacts with its modes inside, and as of a rigid body.",
    )
    section.conclude(
        f"Impacts with modes inside (`modes_in_impacts`): {measuring.find_median(whole_cpu):.1f} ms of the physics for a second of a"
        f" falling plate instead of {measuring.find_median(rigid_cpu):.1f}; without them it is"
        f" {rigid['loudest_db_spl'] - whole['loudest_db_spl']:+.0f} dB. With them its modes have at most"
        f" {100 * energy['modes_share']:.0f} % of what the motion lost. Steps per pulse are no key: 20 leave less than 0.003 of the"
        " restitution and cost 50 to 90 us an impact ([by how much](../decisions/impact.md)), so that there is nothing to be won."
    )
    panels = [
        plots.Panel(name, "physics, ms for a second", "error, relative", {"settings": to_points(rows)}, x_log=True, y_log=True)
        for name, rows in (("contact_step_s, top", top), ("contact_step_s, ball", roll), ("triangles of the ball", shape))
    ]
    panels.append(
        plots.Panel(
            "contact_step_s, falling discs",
            "physics, ms a body for a second",
            "deepest, um",
            {"settings": [(measuring.find_median(cpu), ever) for _, _, ever, _, cpu in discs]},
            x_log=True,
            y_log=True,
        )
    )
    rows = [("knob", "setting", *DATA)] + [
        (name, setting, float(error), float(measuring.find_median(cpu)), float(sounds.find_spread(cpu)))
        for name, table in (("contact_step_s, top", top), ("contact_step_s, ball", roll), ("triangles", shape))
        for setting, _, error, cpu in table
    ]
    section.add_chart(
        "errors",
        plots.draw_panels(
            panels, "Knobs of the physics", "error of a motion against its closed form, depth of falling discs, and the CPU of a second", 2
        ),
        "Error of a motion, and depth of falling discs, against CPU, setting by setting.",
        rows,
    )
    return section
