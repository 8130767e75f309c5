// Method: at a mode with eigenvalue lambda and decay d the receptance a obeys a (lambda - omega^2 + 2 i d omega) = r, and with the other
//   modes as a constant the right side is linear in omega^2: least squares for lambda and d of all functions, after projection of each on
//   what these two terms leave.
// Source: Ewins 2000, "Modal Testing", 4.3 (single modes); Allemang 2003 (MAC).
#include "runtime/exchange/measured.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/exchange/assign.hpp"
#include "runtime/exchange/svg.hpp"

namespace carillon::exchange {
namespace {

constexpr double kProminence = 4.0;    // in power
constexpr std::size_t kLeastHalf = 4;  // lines on each side of a peak
constexpr std::size_t kMostHalf = 200;
constexpr double kExplained = 0.9;
constexpr double kAlone = 2.0, kForbidden = 1e6;  // costs

using Complex = std::complex<double>;

double calc_omega(double hz) { return 2.0 * std::numbers::pi * hz; }

/// Receptances at frequencies above 0.
struct Receptances {
  std::vector<double> omega;                // (L)
  std::vector<std::vector<Complex>> value;  // (functions, L)
};

Receptances calc_receptances(const FrfSet& measured, const std::string& name) {
  Receptances all;
  const std::vector<double>& freq = measured.frfs.front().freq_hz;
  const std::size_t begin = freq.front() > 0.0 ? 0 : 1;
  if (freq.size() < begin + 2 * kLeastHalf + 1)
    throw InputError(fmt::format("{}: a function of {} lines; at least {} are needed", name, freq.size(), begin + 2 * kLeastHalf + 1));
  for (std::size_t i = begin; i < freq.size(); ++i) all.omega.push_back(calc_omega(freq[i]));
  for (std::size_t k = 0; k < measured.frfs.size(); ++k) {
    const Frf& frf = measured.frfs[k];
    const auto is_near = [&](double a, double b) { return std::abs(a - b) <= 1e-4 * (freq[1] - freq[0]); };
    if (!std::equal(frf.freq_hz.begin(), frf.freq_hz.end(), freq.begin(), freq.end(), is_near))
      throw InputError(fmt::format("{}: function {} has other frequencies than the first; write all with the same lines", name, k + 1));
    std::vector<Complex>& value = all.value.emplace_back();
    for (std::size_t i = begin; i < freq.size(); ++i) {
      const Complex by = frf.motion == Motion::kDisplacement ? 1.0
                         : frf.motion == Motion::kVelocity   ? Complex(0.0, all.omega[i - begin])
                                                             : Complex(-all.omega[i - begin] * all.omega[i - begin], 0.0);
      value.push_back(frf.value[i] / by);
    }
  }
  return all;
}

/// (L) Sum of squared accelerances.
std::vector<double> calc_power(const Receptances& all) {
  std::vector<double> power(all.omega.size(), 0.0);
  for (const auto& value : all.value)
    for (std::size_t i = 0; i < power.size(); ++i) power[i] += std::norm(value[i]) * std::pow(all.omega[i], 4);
  return power;
}

/// (L) For each line the lowest one, going down in index, before a line that is higher; the index itself at a line that rises from its
/// neighbour.
std::vector<std::size_t> find_valleys(const std::vector<double>& power) {
  std::vector<std::size_t> valley(power.size()), higher;
  for (std::size_t i = 0; i < power.size(); ++i) {
    valley[i] = i;
    while (!higher.empty() && power[higher.back()] <= power[i]) {
      if (power[valley[higher.back()]] < power[valley[i]]) valley[i] = valley[higher.back()];
      higher.pop_back();
    }
    higher.push_back(i);
  }
  return valley;
}

struct Peak {
  std::size_t line, left, right;  // valleys
};

std::vector<Peak> find_peaks(const std::vector<double>& power) {
  const std::vector<std::size_t> left = find_valleys(power);
  std::vector<std::size_t> right = find_valleys({power.rbegin(), power.rend()});
  std::reverse(right.begin(), right.end());
  for (std::size_t& i : right) i = power.size() - 1 - i;
  std::vector<Peak> peaks;
  for (std::size_t i = 1; i + 1 < power.size(); ++i)
    if (power[i] > power[i - 1] && power[i] >= power[i + 1] && power[i] >= kProminence * power[left[i]] &&
        power[i] >= kProminence * power[right[i]])
      peaks.push_back({i, left[i], right[i]});
  return peaks;
}

/// Least squares of 1 and x on complex values, by an orthonormal basis.
class LineFit {
 public:
  explicit LineFit(const std::vector<double>& x) : x_(x) {
    for (const double v : x) mean_ += v / static_cast<double>(x.size());
    for (const double v : x) spread_ += (v - mean_) * (v - mean_);
  }
  /// Constant and slope.
  std::array<Complex, 2> fit(const std::vector<Complex>& y) const {
    Complex sum = 0.0, slope = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      sum += y[i] / static_cast<double>(y.size());
      slope += (x_[i] - mean_) / spread_ * y[i];
    }
    return {sum - mean_ * slope, slope};
  }
  void remove(std::vector<Complex>& y) const {
    const auto [constant, slope] = fit(y);
    for (std::size_t i = 0; i < y.size(); ++i) y[i] -= constant + x_[i] * slope;
  }

 private:
  const std::vector<double>& x_;
  double mean_ = 0.0, spread_ = 0.0;
};

/// A mode in the lines `begin` to `end`; nullopt: they hold no single mode.
std::optional<MeasuredMode> fit_mode(const Receptances& all, std::size_t begin, std::size_t end, std::size_t at) {
  const double scale = all.omega[at];
  std::vector<double> x;  // omega^2 / scale^2 - 1
  for (std::size_t i = begin; i < end; ++i) x.push_back((all.omega[i] / scale - 1.0) * (all.omega[i] / scale + 1.0));
  const LineFit line(x);
  // a x = a shift + i a omega loss - (line), with lambda = scale^2 (1 + shift), 2 d = scale loss.
  std::array<double, 3> gram{};
  std::array<double, 2> right{};
  double total = 0.0;
  const auto make_columns = [&](const std::vector<Complex>& value) {
    std::array<std::vector<Complex>, 3> columns;
    for (std::size_t i = begin; i < end; ++i) {
      columns[0].push_back(value[i]);
      columns[1].push_back(Complex(0.0, all.omega[i] / scale) * value[i]);
      columns[2].push_back(x[i - begin] * value[i]);
    }
    return columns;
  };
  const auto dot = [](const std::vector<Complex>& a, const std::vector<Complex>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].real() * b[i].real() + a[i].imag() * b[i].imag();
    return sum;
  };
  for (const std::vector<Complex>& value : all.value) {
    auto columns = make_columns(value);
    for (auto& column : columns) line.remove(column);
    gram[0] += dot(columns[0], columns[0]);
    gram[1] += dot(columns[0], columns[1]);
    gram[2] += dot(columns[1], columns[1]);
    right[0] += dot(columns[0], columns[2]);
    right[1] += dot(columns[1], columns[2]);
    total += dot(columns[2], columns[2]);
  }
  const double det = gram[0] * gram[2] - gram[1] * gram[1];
  if (!(det > 1e-24 * gram[0] * gram[2])) return std::nullopt;
  const double shift = (gram[2] * right[0] - gram[1] * right[1]) / det, loss = (gram[0] * right[1] - gram[1] * right[0]) / det;
  const double explained = shift * right[0] + loss * right[1];
  if (!(explained >= kExplained * total) || !(shift > x.front() && shift < x.back()) || !(loss > 0.0)) return std::nullopt;
  MeasuredMode mode{.freq_hz = scale * std::sqrt(1.0 + shift) / (2.0 * std::numbers::pi), .decay_per_s = 0.5 * scale * loss, .residue = {}};
  for (const std::vector<Complex>& value : all.value) {
    const auto columns = make_columns(value);
    std::vector<Complex> rest(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) rest[i] = shift * columns[0][i] + loss * columns[1][i] - columns[2][i];
    const auto [constant, slope] = line.fit(rest);
    // At the pole, x = shift + i loss to first order in the loss.
    mode.residue.push_back(scale * scale * (constant + slope * Complex(shift, loss)));
  }
  return mode;
}

std::vector<MeasuredMode> find_modes(const Receptances& all, const std::vector<double>& power) {
  std::vector<MeasuredMode> modes;
  for (const Peak& peak : find_peaks(power)) {
    const auto is_high = [&](std::size_t i) { return i < power.size() && power[i] > 0.5 * power[peak.line]; };
    std::size_t half = 0;  // lines to half the power, on the wider side
    while (half < kMostHalf && (is_high(peak.line - half) || is_high(peak.line + half))) ++half;  // wraps below 0: not high
    half = std::clamp(2 * half, kLeastHalf, kMostHalf);
    const std::size_t begin = std::max(peak.left, peak.line - std::min(peak.line, half)),
                      end = std::min(peak.right, std::min(power.size() - 1, peak.line + half)) + 1;
    if (end - begin < kLeastHalf + 1) continue;
    if (auto mode = fit_mode(all, begin, end, peak.line)) modes.push_back(std::move(*mode));
  }
  return modes;
}

/// (functions) Points and axes of a function on the bank.
struct PlacedFrf {
  const StruckPoint *response, *reference;
  Vec3 response_axis, reference_axis;
};

/// All functions on the bank, or why not.
std::string place(const bank::Bank& bank, const FrfSet& measured, std::map<std::int64_t, StruckPoint>& points,
                  std::vector<PlacedFrf>& placed) {
  for (std::size_t k = 0; k < measured.frfs.size(); ++k) {
    const Frf& frf = measured.frfs[k];
    for (const std::int64_t node : {frf.response_node, frf.reference_node}) {
      if (points.contains(node)) continue;
      const auto found = measured.nodes_m.find(node);
      if (found == measured.nodes_m.end()) return fmt::format("the file has no position (dataset 15 or 2411) of node {}", node);
      try {
        points.emplace(node, find_struck_point(bank, found->second));
      } catch (const InputError& error) {
        return fmt::format("node {}: {}", node, error.what());
      }
    }
    const Vec3 response = find_axis(frf.response_direction), reference = find_axis(frf.reference_direction);
    if (norm(response) == 0.0 || norm(reference) == 0.0) return fmt::format("function {} names no axis x, y or z", k + 1);
    placed.push_back({&points.at(frf.response_node), &points.at(frf.reference_node), response, reference});
  }
  return "";
}

void calc_pairs(const bank::Bank& played, const std::vector<PlacedFrf>& placed, const std::vector<std::size_t>& modes, double within_cents,
                MeasuredComparison& result) {
  const std::size_t rows = modes.size(), peaks = result.peaks.size(), columns = peaks + rows;
  std::vector<MeasuredPair> all(rows * peaks);
  std::vector<double> cost(rows * columns, kAlone);
  for (std::size_t i = 0; i < rows; ++i) {
    std::vector<double> own;
    for (const PlacedFrf& frf : placed)
      own.push_back(dot(frf.response->shape[modes[i]], frf.response_axis) * dot(frf.reference->shape[modes[i]], frf.reference_axis));
    for (std::size_t j = 0; j < peaks; ++j) {
      const MeasuredMode& peak = result.peaks[j];
      MeasuredPair& pair = all[i * peaks + j] = {
          .mode = modes[i], .peak = j, .cents = 1200.0 * std::log2(peak.freq_hz / played.freq_hz(modes[i])), .mac = {}, .level_db = {}};
      double own_power = 0.0, power = 0.0;
      Complex both = 0.0;
      for (std::size_t k = 0; k < own.size(); ++k) {
        own_power += own[k] * own[k];
        power += std::norm(peak.residue[k]);
        both += own[k] * peak.residue[k];
      }
      if (own_power > 0.0 && power > 0.0) {
        pair.level_db = 10.0 * std::log10(power / own_power);
        if (own.size() > 1) pair.mac = std::norm(both) / (own_power * power);
      }
      const double away = std::abs(pair.cents) / within_cents;
      cost[i * columns + j] = away <= 1.0 ? away * away + 1.0 - pair.mac.value_or(1.0) : kForbidden;
    }
  }
  std::vector<char> has_peak(peaks, 0);
  const std::vector<std::size_t> chosen = assign(cost, rows, columns);
  for (std::size_t i = 0; i < rows; ++i) {
    if (chosen[i] >= peaks) {
      result.modes_alone.push_back(modes[i]);
      continue;
    }
    has_peak[chosen[i]] = 1;
    result.pairs.push_back(all[i * peaks + chosen[i]]);
  }
  for (std::size_t j = 0; j < peaks; ++j)
    if (has_peak[j] == 0) result.peaks_alone.push_back(j);
}

/// Rms accelerance of the bank over the functions [dB].
void calc_bank_level(const bank::Bank& played, const std::vector<PlacedFrf>& placed, MeasuredComparison& result) {
  constexpr std::size_t kMostLines = 1000;
  const double low = result.freq_hz.front(), high = result.freq_hz.back();
  for (std::size_t i = 0; i < kMostLines; ++i) result.bank_hz.push_back(low + (high - low) * static_cast<double>(i) / (kMostLines - 1));
  for (std::size_t m = 0; m < played.mode_count(); ++m)
    if (const double hz = played.freq_hz(m); hz > low && hz < high) result.bank_hz.push_back(hz);
  std::sort(result.bank_hz.begin(), result.bank_hz.end());
  std::vector<double> power(result.bank_hz.size(), 0.0);
  for (const PlacedFrf& frf : placed) {
    const auto value =
        calc_frf(played, *frf.response, frf.response_axis, *frf.reference, frf.reference_axis, Motion::kAcceleration, result.bank_hz);
    for (std::size_t i = 0; i < power.size(); ++i) power[i] += std::norm(value[i]) / static_cast<double>(placed.size());
  }
  for (const double p : power) result.bank_db.push_back(10.0 * std::log10(std::max(p, 1e-300)));
}

}  // namespace

std::vector<MeasuredMode> find_modes(const FrfSet& measured, const std::string& name) {
  const Receptances all = calc_receptances(measured, name);
  return find_modes(all, calc_power(all));
}

MeasuredComparison compare_measured(const bank::Bank& played, const FrfSet& measured, std::size_t most, double within_cents, bool draws,
                                    const std::string& name) {
  const Receptances all = calc_receptances(measured, name);
  const std::vector<double> power = calc_power(all);
  MeasuredComparison result;
  result.frf_count = measured.frfs.size();
  for (std::size_t i = 0; i < power.size(); ++i) {
    result.freq_hz.push_back(all.omega[i] / (2.0 * std::numbers::pi));
    result.level_db.push_back(10.0 * std::log10(std::max(power[i] / static_cast<double>(measured.frfs.size()), 1e-300)));
  }
  result.peaks = find_modes(all, power);
  std::map<std::int64_t, StruckPoint> points;
  std::vector<PlacedFrf> placed;
  result.unknown = place(played, measured, points, placed);
  if (!result.unknown.empty()) placed.clear();
  std::vector<std::size_t> modes;
  const double reach = std::exp2(within_cents / 1200.0);
  for (std::size_t m = 0; m < played.mode_count() && modes.size() < most; ++m)
    if (played.freq_hz(m) * reach > result.freq_hz.front() && played.freq_hz(m) < reach * result.freq_hz.back()) modes.push_back(m);
  if (modes.empty())
    throw InputError(fmt::format("{}: the bank has no mode within the measured band, {:.4g} to {:.4g} Hz", name, result.freq_hz.front(),
                                 result.freq_hz.back()));
  calc_pairs(played, placed, modes, within_cents, result);
  if (draws && !placed.empty()) calc_bank_level(played, placed, result);
  return result;
}

std::string format_table(const MeasuredComparison& comparison, const bank::Bank& played) {
  std::string text = fmt::format("{:>5} {:>12} {:>5} {:>12} {:>9} {:>9} {:>9} {:>10} {:>10}\n", "mode", "Hz", "peak", "Hz", "cents", "MAC",
                                 "level dB", "decay 1/s", "measured");
  const auto number = [](const std::optional<double>& value, int digits) { return value ? fmt::format("{:.{}f}", *value, digits) : "-"; };
  double cents = 0.0;
  for (const MeasuredPair& pair : comparison.pairs) {
    const MeasuredMode& peak = comparison.peaks[pair.peak];
    text += fmt::format("{:>5} {:>12.4f} {:>5} {:>12.4f} {:>9.2f} {:>9} {:>9} {:>10.4g} {:>10.4g}\n", pair.mode + 1,
                        played.freq_hz(pair.mode), pair.peak + 1, peak.freq_hz, pair.cents, number(pair.mac, 5), number(pair.level_db, 2),
                        played.decay_per_s[pair.mode], peak.decay_per_s);
    cents = std::max(cents, std::abs(pair.cents));
  }
  text += comparison.pairs.empty()
              ? "no mode has a peak near it\n"
              : fmt::format("{} pairs from {} functions: within {:.3g} cents\n", comparison.pairs.size(), comparison.frf_count, cents);
  if (!comparison.unknown.empty()) text += fmt::format("no MAC, no levels: {}\n", comparison.unknown);
  for (const std::size_t m : comparison.modes_alone)
    text += fmt::format("mode {} of the bank, {:.4f} Hz, has no peak\n", m + 1, played.freq_hz(m));
  for (const std::size_t p : comparison.peaks_alone)
    text += fmt::format("peak {} at {:.4f} Hz has no mode\n", p + 1, comparison.peaks[p].freq_hz);
  return text;
}

std::string format_json(const MeasuredComparison& comparison, const bank::Bank& played) {
  const auto number = [](double value) { return base::finite_or_null(value, base::significant, 12); };
  const auto or_null = [&](const std::optional<double>& value) { return value ? base::Json(number(*value)) : base::Json(); };
  base::Json root = base::Json::object();
  root.set("functions", comparison.frf_count).set("pairs", base::Json::array());
  for (const MeasuredPair& pair : comparison.pairs) {
    const MeasuredMode& peak = comparison.peaks[pair.peak];
    root["pairs"].add(base::Json::object()
                          .set("first", pair.mode)
                          .set("second", pair.peak)
                          .set("first_hz", number(played.freq_hz(pair.mode)))
                          .set("second_hz", number(peak.freq_hz))
                          .set("cents", number(pair.cents))
                          .set("mac", or_null(pair.mac))
                          .set("level_db", or_null(pair.level_db))
                          .set("first_decay_per_s", number(played.decay_per_s[pair.mode]))
                          .set("second_decay_per_s", number(peak.decay_per_s)));
  }
  root.set("first_alone", base::Json::array(comparison.modes_alone)).set("second_alone", base::Json::array(comparison.peaks_alone));
  if (!comparison.unknown.empty()) root.set("unknown", comparison.unknown);
  return root.text();
}

std::string format_picture(const MeasuredComparison& comparison, const bank::Bank& played, const std::string& bank_name,
                           const std::string& measured_name) {
  constexpr double kWidth = 900.0, kHeight = 420.0, kLeft = 60.0, kTop = 40.0, kRange = 120.0;  // dB
  constexpr std::size_t kColumns = 800;
  const double low_hz = comparison.freq_hz.front(), high_hz = comparison.freq_hz.back();
  double top = *std::max_element(comparison.level_db.begin(), comparison.level_db.end());
  for (const double db : comparison.bank_db) top = std::max(top, db);
  top = 10.0 * std::ceil(0.1 * top);
  const double plot_width = kWidth - kLeft - 20.0, plot_height = kHeight - kTop - 40.0;
  const auto x = [&](double hz) { return kLeft + plot_width * (hz - low_hz) / (high_hz - low_hz); };
  const auto y = [&](double db) { return kTop + plot_height * std::clamp((top - db) / kRange, 0.0, 1.0); };
  std::string text = begin_svg(
      kWidth, kHeight, fmt::format("Rms accelerance [dB re 1 m/(N s²)] over frequency [Hz]: {} black, {} red", measured_name, bank_name));
  for (double db = top; db >= top - kRange; db -= 20.0)
    text += fmt::format(
        "<path d=\"M{0:.0f} {1:.1f}H{2:.0f}\" stroke=\"#ddd\"/><text x=\"{3:.0f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:.0f}</text>\n",
        kLeft, y(db), kWidth - 20.0, kLeft - 6.0, y(db) + 4.0, db);
  const double decade = std::pow(10.0, std::floor(std::log10(0.2 * (high_hz - low_hz)))), digit = 0.2 * (high_hz - low_hz) / decade;
  const double step = decade * (digit < 1.5 ? 1.0 : digit < 3.5 ? 2.0 : digit < 7.5 ? 5.0 : 10.0);
  for (double hz = step * std::ceil(low_hz / step); hz <= high_hz; hz += step)
    text += fmt::format("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{:.5g}</text>\n", x(hz), kHeight - 22.0, hz);
  const auto draw = [&](const std::vector<double>& hz, const std::vector<double>& db, const char* stroke) {
    std::vector<double> highest(kColumns, -1e300);
    for (std::size_t i = 0; i < hz.size(); ++i) {
      const auto column = std::min(static_cast<std::size_t>(kColumns * (hz[i] - low_hz) / (high_hz - low_hz)), kColumns - 1);
      highest[column] = std::max(highest[column], db[i]);
    }
    std::string path;
    for (std::size_t c = 0; c < kColumns; ++c)
      if (highest[c] > -1e300)
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", kLeft + plot_width * (static_cast<double>(c) + 0.5) / kColumns,
                            y(highest[c]));
    text += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\"/>\n", path, stroke);
  };
  if (!comparison.bank_hz.empty()) draw(comparison.bank_hz, comparison.bank_db, "#c03020\" stroke-width=\"2.5");
  draw(comparison.freq_hz, comparison.level_db, "#000");
  for (const MeasuredPair& pair : comparison.pairs)
    text += fmt::format("<path class=\"pair\" d=\"M{0:.1f} {1:.0f}V{2:.0f}\" stroke=\"#2060c0\"/>\n",
                        x(comparison.peaks[pair.peak].freq_hz), kTop - 12.0, kTop - 2.0);
  for (const std::size_t m : comparison.modes_alone)
    if (const double hz = played.freq_hz(m); hz >= low_hz && hz <= high_hz)
      text += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.0f}\" r=\"3\" fill=\"#c03020\"/>\n", x(hz), kTop - 7.0);
  return text + "</svg>\n";
}

}  // namespace carillon::exchange
