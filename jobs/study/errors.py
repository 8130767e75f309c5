"""What ends a study early, and with which exit code."""
import unicodedata


class InputError(Exception):
    """What the user can correct."""


class RunError(Exception):
    """A run that failed, with its exit code. possible_nodes: of a mesh, a count of nodes that can be met, where another was asked for."""

    def __init__(self, code, text, possible_nodes=None):
        super().__init__(text)
        self.code, self.possible_nodes = code, possible_nodes


def printable(text):
    """`text` on one line, without what a terminal obeys: control and format characters as escapes (as config::printable does for the other
    programs)."""

    def show(letter):
        if 0xDC80 <= ord(letter) <= 0xDCFF:  # a byte of a file name that is no UTF-8
            return f"\\x{ord(letter) - 0xDC00:02x}"
        hidden = unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Zl", "Zp") and letter not in "\u00ad\u200c\u200d"
        return f"\\u{ord(letter):04x}" if hidden else letter

    return "".join(map(show, str(text)))
