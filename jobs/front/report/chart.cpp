// Method:     a scale from values to pixels for each axis; ticks at 1, 2 and 5 times powers of ten.
// Source:     none.
// Deviations: more marks than kMaxTitled are one path without titles, which a browser draws at once.
#include "jobs/front/report/chart.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::report {
namespace {

constexpr double kWidth = 920.0;
constexpr std::size_t kMaxTitled = 1500;
constexpr double kMaxDecades = 60.0;

bool is_on(const Axis& axis, double value) { return std::isfinite(value) && (!axis.is_log || value > 0.0); }

/// From the values of an axis to pixels.
class Scale {
 public:
  Scale(const Axis& axis, double low, double high, double from_px, double to_px)
      : is_log_(axis.is_log), low_(turn(low)), high_(turn(high)), from_px_(from_px), to_px_(to_px) {
    if (is_log_) low_ = std::max(low_, high_ - kMaxDecades);
    const double room = std::max(high_ - low_, is_log_ ? 0.3 : std::max(std::abs(high_), 1e-300) * 1e-3);
    const double middle = 0.5 * (low_ + high_);
    low_ = middle - 0.53 * room;
    high_ = middle + 0.53 * room;
  }
  double find(double value) const {
    const double u = (turn(value) - low_) / (high_ - low_);
    return from_px_ + std::clamp(u, 0.0, 1.0) * (to_px_ - from_px_);
  }
  /// Values at round numbers; for a logarithmic axis powers of ten, and 2 and 5 between them where there is room.
  std::vector<double> find_ticks() const { return is_log_ ? find_log_ticks() : find_linear_ticks(); }

 private:
  double turn(double value) const { return is_log_ ? std::log10(std::max(value, std::numeric_limits<double>::min())) : value; }
  std::vector<double> find_log_ticks() const {
    const double decades = high_ - low_;
    const int every = std::max(1, static_cast<int>(std::ceil(decades / 8.0)));
    std::vector<double> ticks;
    for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(std::ceil(high_)); ++power) {
      if (power % every != 0) continue;
      for (const double factor : {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0}) {
        const bool is_wanted = factor == 1.0 || (decades < 4.0 && (factor == 2.0 || factor == 5.0)) || decades < 0.7;
        const double at = power + std::log10(factor);
        if (is_wanted && at >= low_ && at <= high_) ticks.push_back(std::pow(10.0, power) * factor);
      }
    }
    return ticks;
  }
  std::vector<double> find_linear_ticks() const {
    const double rough = (high_ - low_) / 5.0, power = std::pow(10.0, std::floor(std::log10(rough)));
    double step = power;
    for (const double factor : {2.0, 5.0, 10.0})
      if (step < rough) step = factor * power;
    std::vector<double> ticks;
    for (double i = std::ceil(low_ / step); i * step <= high_ && ticks.size() < 20; ++i) ticks.push_back(i * step);
    return ticks;
  }

  bool is_log_ = false;
  double low_ = 0.0, high_ = 1.0, from_px_ = 0.0, to_px_ = 1.0;
};

/// "20", "1k", "1e-9"
std::string format_tick(double value) {
  if (value == 0.0) return "0";
  const double size = std::abs(value);
  if (size >= 999.5 && size < 999.5e3) return fmt::format("{:g}k", std::round(value * 1e-1) * 1e-2);
  if (size >= 0.00095 && size < 1000.0) return fmt::format("{:.4g}", value);
  std::string text = fmt::format("{:.0e}", value);  // 1e-09
  for (const char* zero : {"e-0", "e+0", "e+"})
    if (const auto at = text.find(zero); at != std::string::npos)
      text.replace(at, std::string_view(zero).size(), zero[1] == '-' ? "e-" : "e");
  return text;
}

struct Frame {
  double left = 64.0, right = kWidth - 14.0, top = 12.0, bottom = 250.0;
};

Html draw_axes(const Frame& frame, const Scatter& chart, const Scale& x, const Scale& y) {
  Html out = html("<g class=\"grid\">");
  for (const double tick : x.find_ticks()) out += html("<path d=\"M{0:.1f} {1:.0f}V{2:.0f}\"/>", x.find(tick), frame.top, frame.bottom);
  for (const double tick : y.find_ticks()) out += html("<path d=\"M{0:.0f} {2:.1f}H{1:.0f}\"/>", frame.left, frame.right, y.find(tick));
  out += html("</g>\n<g class=\"tick\">");
  double last_px = -1e9;
  for (const double tick : x.find_ticks()) {
    const double px = x.find(tick);
    if (px - last_px < 34.0) continue;
    last_px = px;
    out += html("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>", px, frame.bottom + 17.0, format_tick(tick));
  }
  last_px = 1e9;
  for (const double tick : y.find_ticks()) {
    const double px = y.find(tick);
    if (last_px - px < 15.0) continue;
    last_px = px;
    out += html("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", frame.left - 7.0, px + 4.0, format_tick(tick));
  }
  out += html("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"end\">{}</text>", frame.right, frame.bottom + 34.0, chart.x.label);
  out += html("<text transform=\"translate(13 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{}</text></g>\n",
              0.5 * (frame.top + frame.bottom), chart.y.label);
  return out;
}

/// One element for all that have no title of their own.
Html draw_path(const char* kind, int colour, const std::vector<Html>& pieces) {
  if (pieces.empty()) return {};
  Html data;
  for (const Html& piece : pieces) data += piece;
  return html("<path class=\"{} c{}\" d=\"{}\"/>\n", kind, colour, data);
}

Html draw_series(const Frame& frame, const Series& series, const std::vector<const Mark*>& marks, const Scale& x, const Scale& y) {
  std::vector<Html> sticks, bars, dots;
  Html titled;
  for (const Mark* mark : marks) {
    const double at = x.find(mark->x), height = y.find(mark->y);
    if (series.is_stick) sticks.push_back(html("M{:.1f} {:.1f}V{:.0f}", at, height, frame.bottom));
    if (mark->x_high > mark->x_low) {
      const double from = x.find(mark->x_low), to = x.find(mark->x_high);
      bars.push_back(html("M{0:.1f} {2:.1f}v6m0 -3H{1:.1f}m0 -3v6", from, to, height - 3.0));
    }
    if (marks.size() > kMaxTitled)
      dots.push_back(html("M{:.1f} {:.1f}h0", at, height));
    else
      titled += html("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\"><title>{}</title></circle>\n", at, height, mark->title);
  }
  Html out = draw_path("stick", series.colour, sticks);
  out += draw_path("bar", series.colour, bars);
  out += draw_path("dots", series.colour, dots);
  if (!titled.empty()) out += html("<g class=\"dot c{}\">\n{}</g>\n", series.colour, titled);
  return out;
}

struct Extent {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void take(const Axis& axis, double value) {
    if (!is_on(axis, value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

Html draw_legend(const std::vector<Series>& series) {
  if (series.size() < 2) return {};
  Html out;
  for (const Series& one : series) out += html("<span class=\"key c{}\"></span>{} ", one.colour, one.name);
  return html("<p class=\"legend\">{}</p>\n", out);
}

}  // namespace

Html draw_bars(std::string_view title, const std::vector<Bar>& bars) {
  if (bars.empty()) return {};
  constexpr double kRow = 27.0, kLabel = 170.0, kText = 180.0;
  double max = 0.0;
  for (const Bar& bar : bars) max = std::max(max, bar.value);
  const double height = kRow * static_cast<double>(bars.size()) + 4.0;
  Html out = html("<div class=\"chart\"><svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n", kWidth, height, title);
  for (std::size_t i = 0; i < bars.size(); ++i) {
    const double top = kRow * static_cast<double>(i) + 2.0;
    const double width = max > 0.0 ? (kWidth - kLabel - kText) * (bars[i].value / max) : 0.0;
    out += html("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", kLabel - 10.0, top + 17.0, escape(bars[i].label, 40));
    out += html("<rect class=\"c0\" x=\"{:.0f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"18\" rx=\"2\"/>", kLabel, top + 3.0,
                std::max(width, 1.0));
    out += html("<text class=\"value\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", kLabel + width + 8.0, top + 17.0, bars[i].text);
  }
  return out += html("</svg></div>\n");
}

Html draw_scatter(const Scatter& chart) {
  Extent across, up;
  for (const double bound : {chart.x.low, chart.x.high}) across.take(chart.x, bound);
  for (const double bound : {chart.y.low, chart.y.high}) up.take(chart.y, bound);
  std::vector<std::vector<const Mark*>> placed(chart.series.size());
  std::size_t some = 0, lost = 0;
  for (std::size_t i = 0; i < chart.series.size(); ++i) {
    for (const Mark& mark : chart.series[i].marks) {
      if (!is_on(chart.x, mark.x) || !is_on(chart.y, mark.y)) {
        ++lost;
        continue;
      }
      ++some;
      placed[i].push_back(&mark);
      for (const double x : {mark.x, mark.x_low, mark.x_high})
        if (x == mark.x || mark.x_high > mark.x_low) across.take(chart.x, x);
      up.take(chart.y, mark.y);
    }
  }
  if (some == 0) return {};
  for (const Line& line : chart.lines) up.take(chart.y, line.y);
  const Frame frame;
  const Scale x(chart.x, across.low, across.high, frame.left, frame.right), y(chart.y, up.low, up.high, frame.bottom, frame.top);
  Html out = html("<div class=\"chart\"><svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n", kWidth, frame.bottom + 40.0,
                  chart.title);
  out += draw_axes(frame, chart, x, y);
  for (const Line& line : chart.lines) {
    if (!is_on(chart.y, line.y)) continue;
    out += html("<path class=\"level\" d=\"M{:.0f} {:.1f}H{:.0f}\"/>", frame.left, y.find(line.y), frame.right);
    out += html("<text class=\"level\" x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", frame.right - 4.0, y.find(line.y) - 5.0,
                line.label);
  }
  for (std::size_t i = 0; i < placed.size(); ++i) out += draw_series(frame, chart.series[i], placed[i], x, y);
  out += html("</svg></div>\n");
  out += draw_legend(chart.series);
  if (lost > 0) out += html("<p class=\"remark\">{} without a place on these axes.</p>\n", lost);
  return out;
}

}  // namespace carillon::report
