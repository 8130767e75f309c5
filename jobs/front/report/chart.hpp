// Charts as SVG inside a page.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "jobs/front/report/html.hpp"

namespace carillon::report {

struct Bar {
  std::string label;
  double value = 0.0;  // finite, not negative
  std::string text;    // behind the bar
};

/// Horizontal bars from zero, the largest across the whole width. `title` is read to those who cannot see it.
Html draw_bars(std::string_view title, const std::vector<Bar>& bars);

struct Axis {
  std::string label;
  bool is_log = false;
  double low = std::numeric_limits<double>::quiet_NaN(), high = low;  // what it shows at least; NaN: what the marks need
};

struct Mark {
  double x = 0.0, y = 0.0;
  double x_low = 0.0, x_high = 0.0;  // error bar along x; none when both are 0
  std::string title;                 // shown under the pointer
};

struct Series {
  std::string name;
  int colour = 0;  // 0 to 2
  std::vector<Mark> marks;
  bool is_stick = false;  // a line from the lower edge to each mark
};

/// A level to hold the marks against.
struct Line {
  double y = 0.0;
  std::string label;
};

struct Scatter {
  std::string title;
  Axis x, y;
  std::vector<Series> series;
  std::vector<Line> lines;
};

/// Marks over two axes. Those without a place on them (not finite, not positive on a logarithmic axis) are left out, and the number of them
/// is said below the chart. Nothing when no mark has a place.
Html draw_scatter(const Scatter& chart);

}  // namespace carillon::report
