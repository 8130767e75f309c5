#!/usr/bin/python3
"""The scaling model: what it must reproduce, how its parts grow, and its counts."""
import dataclasses
import json
import pathlib
import sys
import unittest

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
import counting
import fronts
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
    tree=fronts.Tree(root=900, shrink=0.7, border=4),
    surface_nodes=2e4,
    file_bytes=8e6,
)
RATES = model.Rates(
    dense_gflops=50,
    memory_gb_s=30,
    read_s_per_unknown=2e-6,
    partition_s_per_unknown=3e-6,
    assemble_s_per_unknown=4e-6,
    order_s_per_node=2e-5,
    cut_s_per_node=3e-6,
    factor_gflops=25,
    solve_gflops=20,
    orthogonalise_gflops=25,
    write_s_per_value=2e-8,
)
HERE = model.Machine("here", dense_gflops=50, memory_gb_s=30, latency_s=5e-7, transfer_gb_s=6, disk_gb_s=1)


class Model(unittest.TestCase):
    def setUp(self):
        self.here = model.Model(BODY, RATES, HERE)

    def test_one_rank_here_takes_what_was_measured_here_and_sends_nothing(self):
        parts = self.here.calc(1)
        self.assertAlmostEqual(sum(parts["read"]), 0.2)
        self.assertAlmostEqual(sum(parts["factor"]), 4 * 3e10 / 25e9 + 2e-5 * 1e5 / 3)
        self.assertAlmostEqual(sum(parts["solve"]), 4 * 3e7 * 480 / 20e9)
        self.assertEqual([phase_parts[2] for phase_parts in parts.values()], [0.0] * 7)

    def test_what_is_shared_falls(self):
        few, many = self.here.calc(64), self.here.calc(512)
        for phase in ("assemble", "factor", "solve", "orthogonalise"):
            self.assertLess(many[phase][0], few[phase][0], phase)
            self.assertGreater(many[phase][2], 0)
        self.assertAlmostEqual(few["assemble"][0] / many["assemble"][0], 8)

    def test_memory_of_a_rank_falls_with_the_ranks(self):
        sizes = [self.here.calc_memory_bytes(p) - model.PROGRAM_BYTES for p in (1, 4, 64, 1024)]
        for many, few in zip(sizes[1:], sizes):
            self.assertLess(many, few / 2)


class Messages(unittest.TestCase):
    def test_functions_belong_to_phases(self):
        names = ("carillon::error_bars::estimate_errors", "carillon::mesh::distribute(int)", "carillon::mesh::read_mesh", "main")
        self.assertEqual([messages.find_phase([name]) for name in names], ["error bars", "partition", "read", "other"])


class Tree(unittest.TestCase):
    def test_a_front_that_is_all_pivots_costs_a_third_of_a_cube_and_keeps_half_a_square(self):
        self.assertAlmostEqual(fronts.count_flops(300, 300), 300**3 / 3)
        self.assertAlmostEqual(fronts.count_entries(300, 300), 300**2 / 2)

    def test_two_ranks_share_the_root_and_what_lies_across_their_border(self):
        levels = fronts.Tree(1000, 0.7, 4).list_levels(2)
        self.assertEqual([level.ranks for level in levels], [2, 1, 0.5, 0.25, 0.125, 0.0625])
        self.assertEqual([level.shared for level in levels], [1, 1, 0.5, 0.25, 0.125, 0.0625])
        self.assertEqual({level.group for level in levels}, {2})
        self.assertEqual(fronts.Tree(1000, 0.7, 4).list_levels(1), [])

    def test_a_tree_is_found_again_by_what_it_shares(self):
        tree = fronts.Tree(2500, 0.75, 5)
        found = fronts.fit_tree([(ranks, *fronts.count_shared(tree, ranks)) for ranks in counting.ALL])
        for value, right in zip(dataclasses.astuple(found), dataclasses.astuple(tree)):
            self.assertAlmostEqual(value / right, 1, delta=0.02)

    def test_a_column_of_many_ranks_lies_on_the_root_of_them(self):
        root = fronts.Tree(7200, 0.7, 4).list_levels(64)[0]
        self.assertEqual((root.grid, root.panels), ((8, 8), 100))


class Counts(unittest.TestCase):
    """The model against what count_mapping counts with the real maps of tiles, from 2 to 64 ranks and beyond."""

    BOUNDS = {
        "path": (0.85, 1.2),
        "gang": (0.85, 1.25),
        "entries": (0.95, 1.3),
        "messages": (0.65, 1.15),
        "bytes": (0.85, 1.8),
        "solve messages": (0.75, 1.3),
        "solve bytes": (0.7, 1.3),
        "solve path": (0.75, 1.1),
        "memory": (0.7, 1.4),
    }

    @classmethod
    def setUpClass(cls):
        cls.counted = json.loads((pathlib.Path(__file__).parent / "counted.json").read_text())
        cls.trees = {name: fronts.fit_tree(counting.list_shared(cls.counted[name])) for name in ("t10", "million")}

    def check(self, name, tree, bounds):
        for row in self.counted[name]["rows"]:
            for what, ratio in model.compare(tree, row).items():
                low, high = bounds[what]
                self.assertTrue(low <= ratio <= high, f"{name}, {row['ranks']:.0f} ranks: {what}: model / count {ratio:.2f}")

    def test_all_six_numbers_of_ranks_are_counted(self):
        for name in ("t10", "million"):
            self.assertEqual(tuple(row["ranks"] for row in self.counted[name]["rows"]), counting.ALL)

    def test_the_model_is_near_the_counts_on_2_to_64_ranks(self):
        for name, tree in self.trees.items():
            self.check(name, tree, self.BOUNDS)

    def test_a_wrong_tree_is_noticed(self):
        with self.assertRaises(AssertionError):
            self.check("t10", dataclasses.replace(self.trees["t10"], root=2 * self.trees["t10"].root), self.BOUNDS)

    def test_the_goals_hold_by_counts(self):
        for name in ("t10", "million"):
            for row in self.counted[name]["rows"]:
                self.assertLessEqual(row["path_over_one"], 1.5 if row["ranks"] <= 16 else 2.5)
                self.assertLessEqual(row["fullest"], 1.3)


if __name__ == "__main__":
    unittest.main()
