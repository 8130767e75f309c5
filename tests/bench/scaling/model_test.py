#!/usr/bin/python3
"""The scaling model's sanity: what it must reproduce, how its parts grow, and how messages are assigned to phases."""
import pathlib
import sys
import tempfile
import unittest

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
import messages
import model

BODY = model.Body(
    unknowns=1e5,
    modes=200,
    entries=3e7,
    factor_flops=3e10,
    factorisations=4,
    right_sides=480,
    block=16,
    basis=480,
    separator=900,
    surface_nodes=2e4,
    file_bytes=8e6,
)
RATES = model.Rates(
    dense_gflops=50,
    memory_gb_s=30,
    read_s_per_unknown=2e-6,
    partition_s_per_unknown=3e-6,
    assemble_s_per_unknown=4e-6,
    factor_gflops=25,
    front_gflops=30,
    solve_gflops=20,
    orthogonalise_gflops=25,
    write_s_per_value=2e-8,
    plan_s=1e-6,
    plan_power=2,
)
HERE = model.Machine("here", dense_gflops=50, memory_gb_s=30, latency_s=5e-7, transfer_gb_s=6, disk_gb_s=1)


class Model(unittest.TestCase):
    def setUp(self):
        self.here = model.Model(BODY, RATES, HERE)

    def test_one_rank_here_takes_what_was_measured_here_and_sends_nothing(self):
        parts = self.here.calc(1)
        self.assertAlmostEqual(sum(parts["read"]), 0.2)
        self.assertAlmostEqual(sum(parts["factor"]), 4 * 3e10 / 25e9)
        self.assertAlmostEqual(sum(parts["solve"]), 4 * 3e7 * 480 / 20e9)
        self.assertEqual([phase_parts[2] for phase_parts in parts.values()], [0.0] * 7)

    def test_what_is_shared_falls_and_what_is_not_does_not(self):
        few, many = self.here.calc(64), self.here.calc(512)
        for phase in ("assemble", "factor", "solve", "orthogonalise"):
            self.assertLess(many[phase][0], few[phase][0], phase)
            self.assertGreaterEqual(many[phase][1], few[phase][1], phase)
            self.assertGreater(many[phase][2], 0)
        self.assertAlmostEqual(few["assemble"][0] / many["assemble"][0], 8)

    def test_the_work_of_the_fronts_is_done_once(self):
        flops = sum(2**level * model.count_front_flops(*front) for level, front in enumerate(model.find_fronts(BODY, 8)))
        shared = self.here.calc(8)["factor"][0]
        self.assertAlmostEqual(shared * 8 * 25e9 / 4, BODY.factor_flops - flops, delta=1.0)

    def test_a_front_that_is_all_pivots_costs_a_third_of_a_cube(self):
        self.assertAlmostEqual(model.count_front_flops(300, 300), 300**3 / 3)

    def test_a_slower_memory_slows_the_solves(self):
        starved = model.Machine("starved", dense_gflops=50, memory_gb_s=1, latency_s=5e-7, transfer_gb_s=6, disk_gb_s=1)
        ratio = model.Model(BODY, RATES, starved).calc(1)["solve"][0] / (480 / 16 * 16 * 3e7 / 1e9)
        self.assertAlmostEqual(ratio, 1.0)

    def test_growth_keeps_modes_and_scales_areas(self):
        big = BODY.grow(8e5, 4 / 3, 2)
        self.assertEqual((big.modes, big.basis), (BODY.modes, BODY.basis))
        self.assertAlmostEqual(big.separator / BODY.separator, 4)
        self.assertAlmostEqual(big.entries / BODY.entries, 16)
        self.assertAlmostEqual(big.factor_flops / BODY.factor_flops, 64)

    def test_a_power_law_is_found_again(self):
        self.assertAlmostEqual(model.fit_power([1e3, 1e4, 3e5], [7 * x**1.38 for x in (1e3, 1e4, 3e5)]), 1.38)

    def test_memory_of_a_rank_falls_until_the_largest_front(self):
        sizes = [self.here.calc_memory_bytes(p) for p in (1, 4, 4096)]
        self.assertGreater(sizes[0], 3 * sizes[1])
        self.assertGreater(sizes[2], 2 * 8 * (2.5 * 900 * 2 ** (-2 / 3)) ** 2 / 2)

    def test_spread_fronts_shrink_with_the_ranks_and_the_chain_does_not(self):
        big = model.Model(BODY.grow(1e7, 4 / 3, 2), RATES, HERE)
        times = [[big.calc(p, spread_fronts=spread)["factor"][1] for p in (64, 512)] for spread in (False, True)]
        self.assertGreaterEqual(times[0][1], times[0][0])
        self.assertLess(times[1][1], 0.5 * times[1][0])
        self.assertLess(times[1][0], times[0][0])


class Messages(unittest.TestCase):
    def test_the_innermost_known_function_says_the_phase(self):
        self.assertEqual(
            messages.find_phase(["PetscSFBcastBegin", "carillon::eigen::NodeMatrix::multiply", "carillon::run::run_job"]), "orthogonalise"
        )
        self.assertEqual(
            messages.find_phase(["carillon::ldlt::Factor::solve(double*, int, int)", "carillon::eigen::run_krylov_schur"]), "solve"
        )
        self.assertEqual(
            messages.find_phase(["carillon::ldlt::(anonymous namespace)::Solver::send", "carillon::ldlt::Factor::factorise(double)"]),
            "factor",
        )
        self.assertEqual(messages.find_phase(["main"]), "other")

    def test_a_rank_s_file_is_summed_by_phase_and_kind(self):
        symbols = ([0x1000, 0x2000], ["carillon::ldlt::Factor::solve(double*, int, int)", "carillon::fem::assemble"])
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "messages.0"
            path.write_text(
                "send 3 2400 0.5 1.0 1010 2020\nsend 1 100 0.25 0.0 1040\nallreduce 2 16 0.125 2.0 2010\nwait 9 0 1.0 0.0 1010\n"
            )
            phases = messages.read_rank(path, symbols)
        self.assertEqual(phases["solve"], {"compute_s": 1.0, "mpi_s": 1.75, "send": [4, 2500.0]})
        self.assertEqual(phases["assemble"], {"compute_s": 2.0, "mpi_s": 0.125, "allreduce": [2, 16.0]})

    def test_an_address_belongs_to_the_function_that_begins_before_it(self):
        symbols = ([0x1000, 0x2000], ["a", "b"])
        self.assertEqual([messages.find_function(symbols, at) for at in (0x500, 0x1000, 0x1FFF, 0x2000)], ["?", "a", "a", "b"])


if __name__ == "__main__":
    unittest.main()
