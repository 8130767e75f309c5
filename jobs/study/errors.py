"""Errors of a study and their exit codes."""
import argparse
import unicodedata


class InputError(Exception):
    """An error that the user can correct."""


class RunError(Exception):
    """A failed run with its exit code. possible_nodes: a node count that the mesher can meet, if it refused another."""

    def __init__(self, code, text, possible_nodes=None):
        super().__init__(text)
        self.code, self.possible_nodes = code, possible_nodes


class Parser(argparse.ArgumentParser):
    """Bad arguments raise InputError: one line, like all other errors."""

    def error(self, message):
        raise InputError(f"{message}; see {self.prog} --help")


def printable(text):
    """`text` on one line with control and format characters escaped, as base::printable() does."""

    def show(letter):
        if 0xDC80 <= ord(letter) <= 0xDCFF:  # an invalid byte of a file name
            return f"\\x{ord(letter) - 0xDC00:02x}"
        hidden = unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Zl", "Zp") and letter not in "\u00ad\u200c\u200d"
        return f"\\u{ord(letter):04x}" if hidden else letter

    return "".join(map(show, str(text)))
