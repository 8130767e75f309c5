// Beginning of a picture in SVG.
#pragma once

#include <fmt/format.h>

#include <string>

namespace carillon::exchange {

/// White picture with a title, which may be any text; "</svg>" ends it.
inline std::string begin_svg(double width, double height, const std::string& title) {
  std::string escaped;
  for (const char c : title) escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      "<text x=\"8\" y=\"16\">{2}</text>\n",
      width, height, escaped);
}

}  // namespace carillon::exchange
