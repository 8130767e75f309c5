// Method: shapes at the vertices of the first bank, weighted by the area around them; of the second by linear interpolation at the nearest
//   points of its surface.
// Source: Allemang 2003, "The modal assurance criterion".
#include "runtime/exchange/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "runtime/bank/nearest.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/exchange/assign.hpp"
#include "runtime/exchange/svg.hpp"

namespace carillon::exchange {
namespace {

constexpr double kLeastMac = 0.5;
constexpr double kFarthestShare = 0.1;  // of the extent

/// (V) a third of the triangles around each vertex [m^2].
std::vector<double> calc_areas(const bank::Bank& bank) {
  std::vector<double> areas(bank.vertex_count(), 0.0);
  for (const auto& triangle : bank.triangles)
    for (const std::int32_t vertex : triangle) areas[vertex] += norm(bank::calc_normal(bank.vertices_m, triangle)) / 6.0;
  return areas;
}

/// Shapes of the lowest modes at the vertices of `first`, (modes, V) rows of three, times the root of the area.
std::vector<std::vector<double>> sample(std::size_t modes, const std::vector<std::vector<double>>& at_vertices,
                                        const std::vector<double>& areas) {
  std::vector<std::vector<double>> rows(modes, std::vector<double>(3 * areas.size()));
  for (std::size_t v = 0; v < areas.size(); ++v)
    for (std::size_t m = 0; m < modes; ++m)
      for (std::size_t c = 0; c < 3; ++c) rows[m][3 * v + c] = std::sqrt(areas[v]) * at_vertices[v][3 * m + c];
  return rows;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

Comparison compare(const bank::Bank& first, const bank::Bank& second, std::size_t most, const std::string& second_name) {
  Comparison result;
  const std::size_t rows = result.first_count = std::min(most, first.mode_count());
  const std::size_t columns = result.second_count = std::min(most, second.mode_count());
  const std::vector<double> areas = calc_areas(first);
  const bank::SurfaceTree tree(second);
  std::vector<std::vector<double>> of_first(first.vertex_count()), of_second(first.vertex_count());
  for (std::size_t v = 0; v < first.vertex_count(); ++v) {
    for (std::size_t m = 0; m < rows; ++m) {
      const Vec3 phi = first.shape_at(v, m);
      of_first[v].insert(of_first[v].end(), phi.begin(), phi.end());
    }
    const bank::NearestPlace place = tree.find(first.vertices_m[v]);
    if (place.triangle < 0) throw InputError(fmt::format("{}: has no surface to compare", second_name));
    result.distance_m = std::max(result.distance_m, place.distance_m);
    of_second[v] = bank::calc_shapes(second, place.triangle, place.barycentric);
  }
  const auto [low, high] = bank::find_extent(first.vertices_m);
  const auto [second_low, second_high] = bank::find_extent(second.vertices_m);
  result.distance_m = std::max({result.distance_m, norm(second_low - low), norm(second_high - high)});
  if (result.distance_m > kFarthestShare * norm(high - low))
    throw InputError(fmt::format(
        "{}: its surface is {:.3g} m from that of the other bank, which is {:.3g} m across; compare banks of one body in the same "
        "axes and of the same size",
        second_name, result.distance_m, norm(high - low)));
  const auto a = sample(rows, of_first, areas), b = sample(columns, of_second, areas);
  std::vector<double> of_a, of_b;
  for (const auto& shape : a) of_a.push_back(dot(shape, shape));
  for (const auto& shape : b) of_b.push_back(dot(shape, shape));
  result.mac.resize(rows * columns, 0.0);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < columns; ++j) {
      const double both = dot(a[i], b[j]), norms = of_a[i] * of_b[j];
      if (norms > 0.0) result.mac[i * columns + j] = both * both / norms;
    }
  const bool is_wide = rows <= columns;
  std::vector<double> cost(rows * columns);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < columns; ++j) cost[is_wide ? i * columns + j : j * rows + i] = -result.mac[i * columns + j];
  const std::vector<std::size_t> chosen = is_wide ? assign(cost, rows, columns) : assign(cost, columns, rows);
  std::vector<char> has_first(rows, 0), has_second(columns, 0);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const std::size_t i = is_wide ? k : chosen[k], j = is_wide ? chosen[k] : k;
    const double mac = result.mac[i * columns + j];
    if (mac < kLeastMac) continue;
    has_first[i] = has_second[j] = 1;
    const double level_a = first.radiation_gain[i] * std::sqrt(of_a[i]), level_b = second.radiation_gain[j] * std::sqrt(of_b[j]);
    result.pairs.push_back({i, j, mac, 1200.0 * std::log2(second.freq_hz(j) / first.freq_hz(i)), 20.0 * std::log10(level_b / level_a)});
  }
  std::sort(result.pairs.begin(), result.pairs.end(), [](const ModePair& x, const ModePair& y) { return x.first < y.first; });
  for (std::size_t i = 0; i < rows; ++i)
    if (has_first[i] == 0) result.first_alone.push_back(i);
  for (std::size_t j = 0; j < columns; ++j)
    if (has_second[j] == 0) result.second_alone.push_back(j);
  return result;
}

std::string format_table(const Comparison& comparison, const bank::Bank& first, const bank::Bank& second) {
  std::string text = fmt::format("{:>5} {:>12} {:>5} {:>12} {:>10} {:>10} {:>9}\n", "mode", "Hz", "mode", "Hz", "cents", "MAC", "level dB");
  double cents = 0.0, mac = 1.0, level = 0.0;
  for (const ModePair& pair : comparison.pairs) {
    text += fmt::format("{:>5} {:>12.4f} {:>5} {:>12.4f} {:>10.3f} {:>10.7f} {:>9.3f}\n", pair.first + 1, first.freq_hz(pair.first),
                        pair.second + 1, second.freq_hz(pair.second), pair.cents, pair.mac, pair.level_db);
    cents = std::max(cents, std::abs(pair.cents));
    mac = std::min(mac, pair.mac);
    level = std::max(level, std::abs(pair.level_db));
  }
  if (!comparison.pairs.empty())
    text += fmt::format("{} pairs: within {:.3g} cents, MAC at least {:.7f}, levels within {:.3g} dB\n", comparison.pairs.size(), cents,
                        mac, level);
  else
    text += "no pair has a MAC of 1/2\n";
  const auto list = [&](const char* which, const std::vector<std::size_t>& modes, const bank::Bank& bank) {
    for (const std::size_t m : modes)
      text += fmt::format("mode {} of the {} bank, {:.4f} Hz, has no partner\n", m + 1, which, bank.freq_hz(m));
  };
  list("first", comparison.first_alone, first);
  list("second", comparison.second_alone, second);
  return text;
}

std::string format_json(const Comparison& comparison, const bank::Bank& first, const bank::Bank& second) {
  const auto number = [](double value) { return base::finite_or_null(value, base::significant, 12); };
  base::Json root = base::Json::object();
  root.set("distance_m", number(comparison.distance_m)).set("pairs", base::Json::array());
  for (const ModePair& pair : comparison.pairs)
    root["pairs"].add(base::Json::object()
                          .set("first", pair.first)
                          .set("second", pair.second)
                          .set("first_hz", number(first.freq_hz(pair.first)))
                          .set("second_hz", number(second.freq_hz(pair.second)))
                          .set("cents", number(pair.cents))
                          .set("mac", number(pair.mac))
                          .set("level_db", number(pair.level_db)));
  root.set("first_alone", base::Json::array(comparison.first_alone)).set("second_alone", base::Json::array(comparison.second_alone));
  root.set("mac", base::Json::array());
  for (std::size_t i = 0; i < comparison.first_count; ++i) {
    base::Json row = base::Json::array();
    for (std::size_t j = 0; j < comparison.second_count; ++j) row.add(number(comparison.mac[i * comparison.second_count + j]));
    root["mac"].add(row);
  }
  return root.text();
}

std::string format_picture(const Comparison& comparison, const std::string& first_name, const std::string& second_name) {
  const std::size_t rows = comparison.first_count, columns = comparison.second_count;
  const double cell = std::clamp(600.0 / static_cast<double>(std::max<std::size_t>({rows, columns, 1})), 2.0, 30.0), margin = 50.0;
  const double width = margin + cell * static_cast<double>(columns) + 20.0, height = margin + cell * static_cast<double>(rows) + 20.0;
  std::string text =
      begin_svg(std::max(width, 400.0), height, fmt::format("MAC: modes of {} to the right, of {} downwards", second_name, first_name));
  const auto square = [&](std::size_t i, std::size_t j, const std::string& style) {
    text += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" {}/>\n", margin + cell * static_cast<double>(j),
                        margin + cell * static_cast<double>(i), cell, cell, style);
  };
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < columns; ++j) {
      const int grey = 255 - static_cast<int>(std::lround(225.0 * comparison.mac[i * columns + j]));
      if (grey < 250) square(i, j, fmt::format("fill=\"rgb({0},{0},{0})\"", grey));
    }
  for (const ModePair& pair : comparison.pairs) square(pair.first, pair.second, "fill=\"none\" stroke=\"#c03020\"");
  for (std::size_t i = 0; i < rows; i += 5)
    text += fmt::format("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", margin - 6.0,
                        margin + cell * (static_cast<double>(i) + 0.7), i + 1);
  for (std::size_t j = 0; j < columns; j += 5)
    text += fmt::format("<text x=\"{:.1f}\" y=\"{:.0f}\">{}</text>\n", margin + cell * static_cast<double>(j), margin - 6.0, j + 1);
  return text + "</svg>\n";
}

}  // namespace carillon::exchange
