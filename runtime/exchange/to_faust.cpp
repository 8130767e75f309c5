// Method: the response to a unit impulse is q' = e^(-d t) (cos(v t) - d / v sin(v t)), v = sqrt(omega^2 - d^2): a rotated pair of states,
//   which stays in tune in single precision, unlike a direct form. An over-damped mode is two exponentials. The gain of a point, g phi . n,
//   precedes the resonator, so that modes keep ringing when the next blow is elsewhere. Modes are ranked by their A-weighted exposure
//   within the ear's time constant, at the point where it is largest.
// Source: docs/equations.md E4, E5, E7.
// Deviations: within 5e-7 of critical damping a mode is taken 1e-6 stiffer than its damping.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/bank/blows.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/base/version.hpp"
#include "runtime/exchange/faust.hpp"
#include "runtime/exchange/struck_point.hpp"

namespace carillon::exchange {
namespace {

constexpr double kCritical = 5e-7;       // relative to omega: distance from critical damping
constexpr std::size_t kGroup = 32;       // modes per partial sum: Faust's compile time is quadratic in the terms
constexpr double kDefaultBlowNs = 0.01;  // default blow of the instrument
constexpr double kDefaultPeak = 0.25;    // largest peak of such a blow, relative to full scale

/// Constant part of each Faust file, after the numbers of the body.
constexpr const char* kResonators = R"(
SR = min(192000.0, max(1.0, fconstant(int fSamplingFreq, <math.h>)));
PI = 3.14159265358979323846;

// An under-damped mode, its impulse response: exp(-d t) (cos(v t) - d/v sin(v t)), v = sqrt(w^2 - d^2), w = 2 pi hz. Exact at any rate.
swing(hz, d, gain) = *(gain * (w < PI * SR)) : (turn ~ (_, _)) : sound
with {
  w = 2.0 * PI * hz;
  v = sqrt((w - d) * (w + d));
  c = exp(-d / SR) * cos(v / SR);
  s = exp(-d / SR) * sin(v / SR);
  turn(re, im, x) = c * re - s * im + x, s * re + c * im;
  sound(re, im) = re - im * (d / v);
};

// An over-damped mode: two exponentials.
creep(hz, d, gain) = *(gain * (w < PI * SR)) <: fade(fast) * (fast / (fast - slow)) - fade(slow) * (slow / (fast - slow))
with {
  w = 2.0 * PI * hz;
  fast = d + sqrt((d - w) * (d + w));
  slow = w * w / fast;
  fade(rate) = + ~ *(exp(-rate / SR));
};
)";

constexpr const char* kInstrument = R"(
// The filter alone (faust -pn struck): the impulse of each sample [N s] in, the pressure at 1 m [Pa] out.
struck = body(point);

// An instrument: a blow of the given impulse and length, shaped as that of two elastic bodies.
hammer = impulse * has_begun * (x < 1.0) * pow(max(sin(PI * x), 0.0), 1.5) / (0.5562844 * samples)
with {
  gate = button("[0] strike");
  impulse = hslider("[2] impulse [unit:N s]", 0.01, 0.0001, 1.0, 0.0001);
  samples = max(1.0, 0.001 * SR * hslider("[3] contact time [unit:ms]", 0.5, 0.02, 10.0, 0.01));
  begins = gate > gate';
  has_begun = begins : (max ~ _);
  age = (+(1.0) : *(1.0 - begins)) ~ _;
  x = age / samples;
};
process = hammer : struck : *(hslider("[4] gain [unit:full scale per Pa]", USUAL_GAIN, 0.0, GREATEST_GAIN, SMALL_GAIN));
)";

/// A struck point, and of each mode the pressure at 1 m after a blow of 1 N s there [Pa].
struct Place {
  Vec3 point_m{};
  std::vector<double> gain{};
};

std::vector<Vec3> choose_points(const bank::Bank& bank, const FaustOptions& options) {
  if (!options.points_m.empty()) return options.points_m;
  std::vector<Vec3> points;
  for (const std::size_t v : bank::find_strikes(bank, options.point_count)) points.push_back(bank.vertices_m[v]);
  return points;
}

Place make_place(const bank::Bank& bank, const Vec3& point_m) {
  const StruckPoint struck = find_struck_point(bank, point_m);
  Place place{.point_m = struck.point_m};
  const std::vector<double> velocities = struck.calc_velocities();
  for (std::size_t m = 0; m < bank.mode_count(); ++m) place.gain.push_back(bank.radiation_gain[m] * velocities[m]);
  return place;
}

/// A-weighted exposure of mode m after a blow of 1 N s there [Pa^2 s].
double calc_exposure(const bank::Bank& bank, const Place& place, std::size_t m) {
  const double pressure = bank::calc_a_weight(bank.freq_hz(m)) * place.gain[m];
  return pressure * pressure / (2.0 * (2.0 * bank.decay_per_s[m] + 1.0 / bank::kEarS));
}

std::string write_mode(const bank::Bank& bank, std::size_t m, const std::vector<Place>& places) {
  double hz = bank.freq_hz(m);
  const double omega = 2.0 * std::numbers::pi * hz, d = bank.decay_per_s[m];
  if (std::abs(omega - d) <= kCritical * omega) hz = d * std::sqrt(1.0 + 1e-6) / (2.0 * std::numbers::pi);
  std::string gains;
  for (const Place& place : places) gains += fmt::format(", {:.9e}", place.gain[m]);
  const bool swings = 2.0 * std::numbers::pi * hz > d;
  return fmt::format("  {}({:.12g}, {:.12g}, at(point{}))", swings ? "swing" : "creep", hz, d, gains);
}

std::string replace(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  return text.replace(at, from.size(), to);
}

/// Removes characters that end a quoted text or a comment.
std::string clean(const std::string& name) {
  std::string text;
  for (const char c : name) text += c >= 0x20 && c != 0x7f && c != '"' && c != '\\' ? c : '_';
  return text;
}

}  // namespace

FaustProgram make_faust(const bank::Bank& given, const FaustOptions& options) {
  if (given.mode_count() == 0) throw InputError("the bank has no modes, so it has no sound");
  if (options.modes == 0) throw InputError("0 modes are silent; give 1 or more");
  bank::Bank bank = bank::choose_frequencies(given, bank::Frequencies::kCorrected);
  (void)radiation::put_gains(bank, options.radiation);
  const std::vector<Vec3> points_m = choose_points(bank, options);
  if (points_m.empty() || points_m.size() > kMaxFaustPoints)
    throw InputError(fmt::format("{} points; give 1 to {}", points_m.size(), kMaxFaustPoints));
  std::vector<Place> places;
  for (const Vec3& point_m : points_m) places.push_back(make_place(bank, point_m));

  std::vector<double> silence(bank.mode_count(), 0.0);
  for (std::size_t m = 0; m < silence.size(); ++m)
    for (const Place& place : places) silence[m] = std::min(silence[m], -calc_exposure(bank, place, m));
  std::vector<std::size_t> kept = base::find_sort_order(silence);
  kept.resize(std::min(options.modes, kept.size()));
  std::sort(kept.begin(), kept.end());

  FaustProgram program{.modes = kept.size(), .left_out_db = -std::numeric_limits<double>::infinity()};
  std::vector<bool> is_kept(bank.mode_count(), false);
  for (const std::size_t m : kept) is_kept[m] = true;
  for (const Place& place : places) {
    double all = 0.0, left_out = 0.0;
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      const double exposure = calc_exposure(bank, place, m);
      all += exposure;
      if (!is_kept[m]) left_out += exposure;
    }
    if (left_out > 0.0) program.left_out_db = std::max(program.left_out_db, 10.0 * std::log10(left_out / all));
    program.points_m.push_back(place.point_m);
  }

  const std::string name = clean(options.name);
  std::string& text = program.text;
  text = fmt::format("// {}: {} of {} modes, struck at {} point{}. Written by {}.\n", name, kept.size(), bank.mode_count(), places.size(),
                     places.size() == 1 ? "" : "s", base::describe("carillon-bank"));
  text += "// Compile with -double: in single precision the phase of a mode of 10 kHz is off by 4e-3 after a second.\n";
  for (std::size_t p = 0; p < places.size(); ++p)
    text += fmt::format("// point {}: {:.6g}, {:.6g}, {:.6g} m\n", p, places[p].point_m[0], places[p].point_m[1], places[p].point_m[2]);
  text += fmt::format("declare name \"{}\";\n", name);
  text += kResonators;

  std::string arguments, sum;
  double loudest = 0.0;
  for (std::size_t p = 0; p < places.size(); ++p) {
    arguments += fmt::format(", g{}", p);
    sum += fmt::format("{}g{} * (point == {})", p == 0 ? "" : " + ", p, p);
    double peak = 0.0;
    for (const std::size_t m : kept) peak += std::abs(places[p].gain[m]);
    loudest = std::max(loudest, peak);
  }
  text += fmt::format("\n// The gain of the struck point.\npoint = int(nentry(\"[1] point\", 0, 0, {}, 1));\nat(point{}) = {};\n",
                      places.size() - 1, arguments, sum);
  text += "\n// Of each mode: Hz (undamped), decay [1/s], pressure at 1 m for a blow of 1 N s at each point [Pa].\n";
  std::string groups;
  for (std::size_t first = 0; first < kept.size(); first += kGroup) {
    const std::size_t last = std::min(first + kGroup, kept.size());
    text += fmt::format("group{}(point) = _ <:\n", first / kGroup);
    for (std::size_t k = first; k < last; ++k) text += write_mode(bank, kept[k], places) + (k + 1 < last ? ",\n" : "\n");
    text += "  :> _;\n";
    groups += fmt::format("{}group{}(point)", first == 0 ? "" : ", ", first / kGroup);
  }
  text += fmt::format("body(point) = _ <: {} :> _;\n", groups);
  const double usual = loudest > 0.0 ? kDefaultPeak / (loudest * kDefaultBlowNs) : 1.0;
  std::string instrument = kInstrument;
  for (const auto& [word, value] : {std::pair("USUAL_GAIN", usual), {"GREATEST_GAIN", 100.0 * usual}, {"SMALL_GAIN", 0.001 * usual}})
    instrument = replace(instrument, word, fmt::format("{:.6e}", value));
  text += instrument;
  return program;
}

}  // namespace carillon::exchange
