#include "precompute/analytic/measured.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::analytic {
namespace {

constexpr std::uint64_t kMaxBytes = 64 << 20;
constexpr std::size_t kMaxRows = 40000, kMaxPoints = 10000;
constexpr double kT60 = 6.907755278982137;  // ln 1000: T60 times decay
constexpr double kMaxGain = 1e9, kFarthestM = 1e4;
constexpr std::size_t kMaxShown = 80;  // characters of a cell in a message

std::string_view trim(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '"'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split(std::string_view text, char mark) {
  std::vector<std::string_view> parts;
  for (std::size_t at = 0;;) {
    const std::size_t end = text.find(mark, at);
    parts.push_back(trim(text.substr(at, end == std::string_view::npos ? end : end - at)));
    if (end == std::string_view::npos) return parts;
    at = end + 1;
  }
}

std::optional<double> parse_number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::optional<Vec3> parse_point(std::string_view name) {
  Vec3 point{};
  int found = 0;
  for (const std::string_view word : split(name, ' ')) {
    if (word.empty()) continue;
    const std::optional<double> value = parse_number(word);
    if (!value || found == 3) return std::nullopt;
    point[found++] = *value;
  }
  return found == 3 ? std::optional(point) : std::nullopt;
}

/// Column roles.
struct Columns {
  int freq = -1, decay = -1, t60 = -1;
  std::vector<int> gains;
};

Columns read_names(const std::vector<std::string_view>& names, const std::string& place, ModesTable& table) {
  Columns columns;
  const auto take = [&](int& slot, int i, std::string_view name) {
    if (slot >= 0) throw InputError(fmt::format("{}: column \"{}\" occurs twice; remove one", place, name));
    slot = i;
  };
  int everywhere = -1;
  for (int i = 0; i < static_cast<int>(names.size()); ++i) {
    const std::string_view name = names[i];
    if (name == "frequency_hz") {
      take(columns.freq, i, name);
    } else if (name == "decay_per_s") {
      take(columns.decay, i, name);
    } else if (name == "t60_s") {
      take(columns.t60, i, name);
    } else if (name == "gain") {
      take(everywhere, i, name);
      columns.gains.push_back(i);
    } else if (const std::optional<Vec3> point = parse_point(name)) {
      if (std::find(table.points_m.begin(), table.points_m.end(), *point) != table.points_m.end())
        throw InputError(fmt::format("{}: the point \"{}\" occurs twice; remove one", place, base::printable(name.substr(0, kMaxShown))));
      if (std::any_of(point->begin(), point->end(), [](double x) { return std::abs(x) > kFarthestM; }))
        throw InputError(fmt::format("{}: the point \"{}\" is too far away; its numbers are metres, up to {:g}", place,
                                     base::printable(name.substr(0, kMaxShown)), kFarthestM));
      columns.gains.push_back(i);
      table.points_m.push_back(*point);
    } else {
      throw InputError(
          fmt::format("{}: column \"{}\" is not known; columns are frequency_hz, decay_per_s or t60_s, and gain or points such "
                      "as \"0.1 0 0.02\"",
                      place, base::printable(name.substr(0, kMaxShown))));
    }
  }
  if (columns.freq < 0) throw InputError(fmt::format("{}: column frequency_hz is missing", place));
  if ((columns.decay < 0) == (columns.t60 < 0)) throw InputError(fmt::format("{}: give one of the columns decay_per_s and t60_s", place));
  if (columns.gains.empty() || (everywhere >= 0 && !table.points_m.empty()))
    throw InputError(fmt::format("{}: give a column gain, or columns of points such as \"0.1 0 0.02\", not both", place));
  if (table.points_m.size() > kMaxPoints) throw InputError(fmt::format("{}: more than {} points", place, kMaxPoints));
  return columns;
}

}  // namespace

ModesTable read_modes_table(const std::filesystem::path& file) {
  const std::string text = base::read_file(file, "table of modes", kMaxBytes);
  base::refuse_utf16(text, file.string());
  ModesTable table;
  std::optional<Columns> columns;
  std::size_t count = 0;
  int number = 0;
  struct Row {
    double freq_hz, decay_per_s;
    std::vector<double> gains;
  };
  std::vector<Row> rows;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string_view line = trim(std::string_view(text).substr(at, end - at));
    at = end + 1;
    const std::string place = fmt::format("{}:{}", file.string(), ++number);
    if (number == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    if (line.empty() || line.starts_with('#')) continue;
    const std::vector<std::string_view> cells = split(line, ',');
    if (!columns) {
      columns = read_names(cells, place, table);
      count = cells.size();
      continue;
    }
    if (cells.size() != count) throw InputError(fmt::format("{}: {} values, and there are {} columns", place, cells.size(), count));
    const auto get = [&](int column) {
      const std::string_view cell = cells[column];
      const std::optional<double> value = parse_number(cell);
      if (!value) throw InputError(fmt::format("{}: \"{}\" is not a finite number", place, base::printable(cell.substr(0, kMaxShown))));
      return *value;
    };
    Row row{get(columns->freq), 0.0, {}};
    if (!(row.freq_hz > 0.0 && row.freq_hz < 1e9))
      throw InputError(fmt::format("{}: a frequency is {:g} Hz; give one above 0 and below 1e9", place, row.freq_hz));
    if (columns->t60 >= 0) {
      const double t60 = get(columns->t60);
      if (!(t60 > 0.0)) throw InputError(fmt::format("{}: t60_s is {:g}; give one above 0", place, t60));
      row.decay_per_s = kT60 / t60;
    } else {
      row.decay_per_s = get(columns->decay);
    }
    if (!(row.decay_per_s >= 0.0 && row.decay_per_s < 2.0 * std::numbers::pi * row.freq_hz))
      throw InputError(fmt::format("{}: the decay is {:g} 1/s, but a mode of {:g} Hz is oscillatory from 0 to {:g} 1/s only", place,
                                   row.decay_per_s, row.freq_hz, 2.0 * std::numbers::pi * row.freq_hz));
    for (const int column : columns->gains) {
      row.gains.push_back(get(column));
      if (std::abs(row.gains.back()) > kMaxGain)
        throw InputError(fmt::format("{}: a gain is {:g} kg^-1/2, more than any body has", place, row.gains.back()));
    }
    if (rows.size() == kMaxRows) throw InputError(fmt::format("{}: more than {} modes", place, kMaxRows));
    rows.push_back(std::move(row));
  }
  if (!columns || rows.empty())
    throw InputError(fmt::format("{}: no modes; give a line of column names and a line per mode", file.string()));
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.freq_hz < b.freq_hz; });
  for (Row& row : rows) {
    table.freq_hz.push_back(row.freq_hz);
    table.decay_per_s.push_back(row.decay_per_s);
    table.gains.push_back(std::move(row.gains));
  }
  return table;
}

MeasuredObject::MeasuredObject(const job::MeasuredBody& body) : table_(read_modes_table(body.csv)) {
  half_m_ = 0.5 * Vec3{body.size_m[0], body.size_m[1], body.size_m[2]};
  if (!table_.points_m.empty()) {
    Vec3 low = table_.points_m[0], high = low;
    for (const Vec3& p : table_.points_m)
      for (std::size_t c = 0; c < 3; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
    centre_m_ = 0.5 * (low + high);
    for (std::size_t c = 0; c < 3; ++c)
      if (high[c] - low[c] > 2.0 * half_m_[c] * (1.0 + 1e-9))
        throw InputError(fmt::format("{}: the points span {:g} m along {}, and \"size_m\" is {:g} there; make it larger", body.csv.string(),
                                     high[c] - low[c], "xyz"[c], 2.0 * half_m_[c]));
  }
  rigid.mass_kg = body.mass_kg;
  rigid.volume_m3 = body.size_m[0] * body.size_m[1] * body.size_m[2];
  rigid.centre_m = centre_m_;
  for (std::size_t c = 0; c < 3; ++c) {
    const double b = body.size_m[(c + 1) % 3], d = body.size_m[(c + 2) % 3];
    rigid.inertia_kg_m2[4 * c] = body.mass_kg * (b * b + d * d) / 12.0;
  }
  rigid_modes = 6;
  theory = "measured modes";
  method = fmt::format("the table {}; modes that it omits are unknown", body.csv.filename().string());
}

ModeList MeasuredObject::list_modes(double high_hz, std::int64_t) {
  ModeList list{{}, high_hz};
  for (std::size_t m = 0; m < table_.freq_hz.size() && table_.freq_hz[m] <= high_hz; ++m) {
    const double omega = 2.0 * std::numbers::pi * table_.freq_hz[m];
    list.modes.push_back({omega * omega, 0.0, {static_cast<int>(m), 0, 0, 0}, fmt::format("{}", m + 1)});
  }
  return list;
}

void MeasuredObject::calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const {
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t p = 0; p < table_.points_m.size(); ++p) {
    const Vec3 apart = table_.points_m[p] - point_m;
    if (const double now = dot(apart, apart); now < least) least = now, nearest = p;
  }
  // Motion along the normal of the nearest side.
  std::size_t axis = 0;
  double out = -1.0;
  for (std::size_t c = 0; c < 3; ++c)
    if (const double now = std::abs(point_m[c] - centre_m_[c]) / half_m_[c]; now > out) out = now, axis = c;
  Vec3 normal{};
  normal[axis] = point_m[axis] < centre_m_[axis] ? -1.0 : 1.0;
  for (std::size_t m = 0; m < modes.size(); ++m) phi[m] = table_.gains[modes[m].index[0]][nearest] * normal;
}

ClosedSurface MeasuredObject::make_surface(int grid) const {
  ClosedSurface surface;
  std::map<std::array<int, 3>, std::int32_t> numbers;
  const auto get = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = numbers.try_emplace(at, static_cast<std::int32_t>(surface.vertices_m.size()));
    if (is_new) {
      Vec3 x = centre_m_;
      for (std::size_t c = 0; c < 3; ++c) x[c] += half_m_[c] * (2.0 * at[c] / grid - 1.0);
      surface.vertices_m.push_back(x);
    }
    return entry->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int side : {0, grid})
      for (int i = 0; i < grid; ++i)
        for (int j = 0; j < grid; ++j) {
          const auto at = [&](int a, int b) {
            std::array<int, 3> place{};
            place[axis] = side;
            place[(axis + 1) % 3] = a;
            place[(axis + 2) % 3] = b;
            return get(place);
          };
          const std::int32_t a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if (side == grid) {
            surface.triangles.push_back({a, b, c});
            surface.triangles.push_back({a, c, d});
          } else {
            surface.triangles.push_back({a, c, b});
            surface.triangles.push_back({a, d, c});
          }
        }
  return surface;
}

}  // namespace carillon::analytic
