"""Errors and text of carillon-draw."""
import pathlib
import unicodedata

STANDARD_OUTPUT = pathlib.Path("-")


class InputError(Exception):
    """Invalid input; the message includes the remedy."""


class SystemError_(Exception):
    """A failure of the system."""


def printable(text):
    """`text` on one line, control and format characters as escapes (like base::printable)."""

    def show(letter):
        if 0xDC80 <= ord(letter) <= 0xDCFF:  # a byte of a file name that is not UTF-8
            return f"\\x{ord(letter) - 0xDC00:02x}"
        hidden = unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Zl", "Zp") and letter not in "\u00ad\u200c\u200d"
        return f"\\u{ord(letter):04x}" if hidden else letter

    return "".join(map(show, str(text)))
