// Text of strangers on a terminal and in JSON.
#pragma once

#include <string>
#include <string_view>

namespace carillon::base {

/// `text` on one line and without a character that a terminal obeys or that hides what is written: C0 and C1 controls, DEL, marks that turn
/// or embed the direction of writing, line and paragraph separators and invisible format characters become escapes as JSON writes them
/// (\n, \t, \u001b; \U000e0041 beyond four digits), and each byte that is no UTF-8 becomes \x9b. The rest stays as it is.
std::string printable(std::string_view text);

/// The same with line feeds and tabs as they are: for texts of several lines.
std::string printable_lines(std::string_view text);

/// A text as JSON writes it, in quotation marks. The characters above become \uNNNN, so that a terminal shows JSON as it is; each byte that
/// is no UTF-8 stays as it is.
std::string quote(std::string_view text);

}  // namespace carillon::base
