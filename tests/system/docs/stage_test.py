#!/usr/bin/python3
"""Comparison of the tables of an example's page with those of a run, and updates of the page.

usage: stage_test.py SOURCE_DIR
"""
import pathlib
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop(1))
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "docs/examples"))
import stage as tools

ROWS = [("bowl", "base [Hz]", "decay", "CPU s"), ("oak", "547.15", "1.2e-05 (+0.01 %)", "3.1"), ("ash", "1,024", "", "silent")]
PAGE = "# Bowls\n\n<!-- begin figures bowls -->\n<!-- end figures bowls -->\n\nWords.\n"


class Figures(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.scratch.name)
        self.page = self.folder / "README.md"
        self.page.write_text(PAGE)

    def tearDown(self):
        self.scratch.cleanup()

    def play(self, rows, quick=False, update=False, fails=False):
        """(unmet checks, failure) of a run with these figures."""
        stage = tools.Stage(self.folder, self.folder, self.folder / "out", quick)
        stage.show("bowls", rows, ["CPU s"])
        stage.expect("something", not fails)
        failed = stage.finish(update=update)
        return [what for what, met in stage.checks if not met], failed

    def changed(self, row, column, text):
        rows = [list(one) for one in ROWS]
        rows[row][column] = text
        return rows

    def test_a_page_without_the_figures_of_a_run_fails(self):
        for quick in (False, True):
            said, failed = self.play(ROWS, quick)
            self.assertTrue(failed)
            self.assertIn("--update", said[0])

    def test_an_update_makes_both_forms_agree_and_leaves_the_words(self):
        short = self.changed(1, 1, "560.00")
        for rows, quick in ((ROWS, False), (short, True)):
            self.assertIsNone(self.play(rows, quick, update=True)[1])
        text = self.page.read_text()
        self.assertIn(
            "| oak | 547.15 | 1.2e-05 (+0.01 %) | 3.1 |\n| ash | 1,024 |  | silent |\n<!-- end figures bowls -->\n\nWords.\n", text
        )
        self.assertIn("<!-- short form bowls\n| bowl ", text)
        self.assertIsNone(self.play(ROWS)[1])
        self.assertIsNone(self.play(short, quick=True)[1])
        for rows, quick in ((ROWS, False), (short, True)):
            self.play(rows, quick, update=True)
        self.assertEqual(self.page.read_text(), text)

    def test_other_figures_fail_and_costs_may_differ(self):
        self.play(ROWS, update=True)
        for row, column, text in (
            (1, 1, "547.18"),
            (1, 1, "-547.15"),
            (1, 2, "1.5e-05 (+0.01 %)"),
            (1, 2, "1.2e-05 (-0.02 %)"),
            (1, 2, ""),
            (2, 1, "1,027"),
            (2, 0, "elm"),
            (0, 1, "base [kHz]"),
        ):
            self.assertTrue(self.play(self.changed(row, column, text))[1], text)
        for row, column, text in ((1, 1, "547.17"), (1, 3, "99"), (2, 3, "7"), (1, 2, "1.3e-05 (+0.02 %)")):
            self.assertIsNone(self.play(self.changed(row, column, text))[1], text)
        self.assertTrue(self.play(ROWS[:2])[1])

    def test_a_run_that_fails_does_not_change_the_page(self):
        self.assertTrue(self.play(ROWS, update=True, fails=True)[1])
        self.assertEqual(self.page.read_text(), PAGE)


if __name__ == "__main__":
    unittest.main()
