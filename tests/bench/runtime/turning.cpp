// Whether twenty bodies that turn are heard in real time by a listener that walks, and how far what is heard is from the truth.
//
// usage: bench_turning [--quick] [--error] [--bank BANK]     prints the figures of docs/reports/performance-runtime.md
//
// Method:     cost: bodies of 228 modes from 0.8 to 20 kHz, of orders as the bunny has them (L = k R + 4, R = 84 mm), every coefficient
//             random, each body with tables of its own; they stand in a ring of 2 to 4 m, turn about axes of their own, and are struck
//             about twice a second; the listener walks through at 1.5 m/s; two ears. CPU time of a call of 256 samples, as carillon-live
//             makes them, the first 40 left out; rounds in turn, the median of rounds.
//             error (alone with --error): one mode at a time of a body that turns about an axis across the way to the one microphone, 1.5 m
//             away. The state of the mode over time is that of two bodies which send one monopole, in phase and 90 degrees ahead;
//             multiplied with transfers that are looked up every 16 samples and go by cubics between, it is the reference. The rms of the
//             difference over that of what is heard of the mode over all directions.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstring>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/instructions.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace {

using namespace carillon;
using std::numbers::pi;
using synth::Effect;
constexpr double kRate = 48000.0, kRadius = 0.0842;
constexpr int kModes = 228, kFrames = 256;

bank::Bank make_bank(unsigned seed) {
  std::vector<testing::InventedMode> modes;
  std::vector<testing::ModeMultipoles> multipoles;
  std::mt19937 random(seed);
  std::normal_distribution<double> number;
  for (int m = 0; m < kModes; ++m) {
    const double share = m / (kModes - 1.0), freq_hz = 800.0 + 19200.0 * std::pow(share, 0.735);
    modes.push_back({freq_hz, 0.5, 1e-2, {0.3, -0.2, 1.0}, 0.1});
    const int order = static_cast<int>(2.0 * pi * freq_hz / bank::kSoundSpeedMs * kRadius) + 4;
    testing::ModeMultipoles own(static_cast<std::size_t>((order + 1) * (order + 1)));
    for (auto& a : own) a = {number(random), number(random)};
    multipoles.push_back(own);
  }
  bank::Bank bank = testing::make_cube_bank(modes);
  testing::give_multipoles(bank, multipoles, kRadius);
  return bank;
}

events::Quaternion turn_about(const Vec3& axis, double angle) {
  const double s = std::sin(0.5 * angle);
  return {std::cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
}

Vec3 make_axis(std::mt19937& random) {
  std::normal_distribution<double> number;
  const Vec3 axis{number(random), number(random), number(random)};
  return (1.0 / norm(axis)) * axis;
}

struct Times {
  double p50_us = 0.0, p99_us = 0.0, max_us = 0.0, looked_up = 0.0;
};

/// One round.
Times play(const std::vector<std::shared_ptr<const synth::Model>>& models, synth::Isa isa, synth::EffectSet effects, double turn_rad_s,
           double walk_m_s, int calls) {
  synth::Synthesiser synthesiser({.rate_hz = kRate, .listener_m = {-4.0, 0.0, 0.0}, .ring_events = 1 << 15});
  std::mt19937 random(7);
  std::vector<Vec3> axes, places;
  const auto count = static_cast<int>(models.size());
  for (int b = 0; b < count; ++b) {
    const double angle = 2.0 * pi * b / count, distance = 2.0 + 2.0 * (b % 5) / 4.0;
    places.push_back({distance * std::cos(angle), distance * std::sin(angle), 0.5});
    axes.push_back(make_axis(random));
    synthesiser.add_body(models[b], {.position_m = places.back(), .effects = effects, .max_waypoints = 128, .isa = isa});
  }
  std::array<float, kFrames> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  std::vector<double> spent;
  std::uniform_real_distribution<double> wait(0.2, 0.8);
  std::vector<double> struck_s(models.size());
  for (double& s : struck_s) s = 0.1 * wait(random);
  double pushed_s = 0.0;
  for (int call = 0; call < calls; ++call) {
    const double until_s = synthesiser.get_time_s() + 0.05;
    for (; pushed_s < until_s; pushed_s += 0.01) {
      for (int b = 0; b < count; ++b) {
        const std::size_t i = b;
        for (; struck_s[i] < pushed_s; struck_s[i] += wait(random))
          synthesiser.push(events::Impulse{
              .time_s = std::max(struck_s[i], synthesiser.get_horizon_s()), .body = b, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 5e-5});
        if (turn_rad_s > 0.0) synthesiser.push(events::BodyMotion{pushed_s, b, places[i], {}, turn_about(axes[i], turn_rad_s * pushed_s)});
      }
      if (walk_m_s > 0.0)
        synthesiser.push(events::Listener{.time_s = pushed_s,
                                          .position_m = {-4.0 + walk_m_s * pushed_s, 0.1, 0.0},
                                          .velocity_m_s = {walk_m_s, 0.0, 0.0},
                                          .rotation = {1.0, 0.0, 0.0, 0.0}});
    }
    const double begin = base::get_thread_cpu_s();
    synthesiser.process(out.data(), 2, kFrames);
    if (call >= 40) spent.push_back(1e6 * (base::get_thread_cpu_s() - begin));
  }
  std::sort(spent.begin(), spent.end());
  const auto pick = [&](double share) { return spent[share * (static_cast<double>(spent.size()) - 1.0)]; };
  double looked_up = 0.0;
  for (int b = 0; b < count; ++b) looked_up += static_cast<double>(synthesiser.get_effect_counters(b).units[Effect::kDirectivity]);
  return {pick(0.5), pick(0.99), spent.back(), looked_up / calls};
}

double find_median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// `given`: a bank of which all bodies are, or nullptr.
void measure_cost(const bank::Bank* given, bool quick) {
  struct Row {
    const char* name;
    int bodies;
    synth::EffectSet effects;
    double turn_rad_s, walk_m_s;
    std::vector<Times> rounds{};
  };
  struct Kind {
    const char* name;
    base::Instructions instructions;
  };
  const synth::EffectSet plain = synth::kDefaultEffects, directed = plain.with(Effect::kDirectivity);
  const double deadline_us = 1e6 * kFrames / kRate;
  std::printf("%s, two ears, calls of %d samples: %.0f us; CPU time, us\n",
              given != nullptr ? "bodies of one bank" : "228 modes a body, random multipoles, tables of its own", kFrames, deadline_us);
  std::printf("| instructions | scene | p50 | p99 | largest | p99 / deadline | looked up a block |\n|---|---|--:|--:|--:|--:|--:|\n");
  for (const Kind kind : {Kind{"AVX2", base::Instructions::kAvx2}, Kind{"AVX-512", base::Instructions::kAvx512}}) {
    if (base::find_instructions() < kind.instructions) continue;
    std::vector<std::shared_ptr<const synth::Model>> models;
    for (int b = 0; b < (quick ? 20 : 40); ++b) {
      if (given != nullptr && b > 0) {
        models.push_back(models.front());
        continue;
      }
      const bank::Bank bank = given != nullptr ? *given : make_bank(static_cast<unsigned>(b) + 1);
      models.push_back(
          synth::Model::make(bank, {.rate_hz = kRate, .transfers = std::make_shared<const radiation::Transfers>(bank, kind.instructions)}));
    }
    std::vector<Row> rows{{"20 bodies turn at 10 rad/s, `directivity` off", 20, plain, 10.0, 1.5},
                          {"20 bodies stand, the listener walks", 20, directed, 0.0, 1.5},
                          {"20 bodies turn at 1 rad/s, the listener walks", 20, directed, 1.0, 1.5},
                          {"20 bodies turn at 10 rad/s, the listener walks", 20, directed, 10.0, 1.5}};
    if (!quick) rows.push_back({"40 bodies turn at 10 rad/s, the listener walks", 40, directed, 10.0, 1.5});
    for (int round = 0; round < (quick ? 1 : 5); ++round)
      for (Row& row : rows)
        row.rounds.push_back(play({models.begin(), models.begin() + row.bodies}, kind.instructions, row.effects, row.turn_rad_s,
                                  row.walk_m_s, quick ? 60 : 600));
    for (const Row& row : rows) {
      const auto find = [&](double Times::*value) {
        std::vector<double> values;
        for (const Times& times : row.rounds) values.push_back(times.*value);
        return find_median(values);
      };
      std::printf("| %s | %s | %.0f | %.0f | %.0f | %.2f | %.0f |\n", kind.name, row.name, find(&Times::p50_us), find(&Times::p99_us),
                  find(&Times::max_us), find(&Times::p99_us) / deadline_us, find(&Times::looked_up) * synth::kBlock / kFrames);
    }
  }
}

/// A bank's mode alone, heard at one microphone.
std::vector<float> hear(const std::shared_ptr<const synth::Model>& model, const Vec3& place_m, const Vec3& microphone_m, const Vec3& axis,
                        double turn_rad_s, int frames, std::int32_t triangle) {
  synth::Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {microphone_m}, .max_waypoints = 512, .ring_events = 4096});
  synthesiser.add_body(model, {.position_m = place_m, .effects = {Effect::kModal, Effect::kDirectivity, Effect::kTwoEars}});
  synthesiser.push(events::Impulse{.time_s = 0.001, .body = 0, .triangle = triangle, .impulse_n_s = {0.1, 0.2, 1.0}});
  for (int i = 0; i * 0.005 <= frames / kRate + 0.02; ++i)
    synthesiser.push(events::BodyMotion{i * 0.005, 0, place_m, {}, turn_about(axis, turn_rad_s * i * 0.005)});
  std::vector<float> sound(frames);
  float* out = sound.data();
  synthesiser.process(&out, 1, frames);
  return sound;
}

void measure_error(bank::Bank bank, const char* name, bool quick) {
  const int frames = quick ? 2400 : 7200;
  const Vec3 away{1.2, 0.8, 0.41}, across = cross(away, Vec3{1.0, 2.0, 3.0}), axis = (1.0 / norm(across)) * across;
  bank.rigid.centre_m = bank.multipoles.centre_m;  // so that it turns about their centre, and the way to the microphone stays
  std::fill(bank.decay_per_s.begin(), bank.decay_per_s.end(), 0.5);
  const radiation::Transfers transfers(bank);
  // Monopoles of 1 and of i at the sphere, by hand: T = R / r and i R / r without its travel.
  std::array<bank::Bank, 2> states{bank, bank};
  for (std::size_t s = 0; s < 2; ++s) {
    const std::complex<double> one = s == 0 ? std::complex<double>(1.0, 0.0) : std::complex<double>(0.0, 1.0);
    const std::vector<testing::ModeMultipoles> monopoles(bank.mode_count(), testing::ModeMultipoles{one * std::sqrt(4.0 * pi)});
    testing::give_multipoles(states[s], monopoles, bank.multipoles.radius_m, bank.multipoles.centre_m);
  }
  const std::array<std::shared_ptr<const synth::Model>, 3> models{synth::Model::make(bank, {.rate_hz = kRate}),
                                                                  synth::Model::make(states[0], {.rate_hz = kRate}),
                                                                  synth::Model::make(states[1], {.rate_hz = kRate})};
  const double spread = bank.multipoles.radius_m / norm(away);
  std::printf("%s, turning, error of the rendered sound [dB]\n| rad/s | modes | mean | worst | L of the worst | above L = 9, worst |\n",
              name);
  std::printf("|--:|--:|--:|--:|--:|--:|\n");
  for (const double turn_rad_s : {1.0, 5.0, 10.0}) {
    double sum = 0.0, worst = -400.0, worst_high = -400.0;
    int order = 0, count = 0;
    const int each = quick ? 40 : static_cast<int>(bank.mode_count()) > 300 ? 4 : 1;
    for (int m = 0; m < static_cast<int>(bank.mode_count()); m += each) {
      if (bank.freq_hz(m) > 20000.0) continue;
      std::array<std::vector<float>, 3> sound;
      for (std::size_t i = 0; i < 3; ++i)
        sound[i] = hear(synth::Model::make_solo(*models[i], m), {}, away, axis, i == 0 ? turn_rad_s : 0.0, frames, 0);
      // Nodes of 16 samples, from two before the first.
      std::vector<std::complex<double>> node;
      const std::array<std::int32_t, 1> mode{m};
      for (int i = -2; i * 16 <= frames + 48; ++i) {
        const double t = (16.0 * i - synth::Synthesiser::kLatency) / kRate;
        const double angle = turn_rad_s * std::max(t, 0.0);
        const Vec3 place = synth::turn(turn_about(axis, -angle), away) + transfers.get_centre_m();
        std::array<std::complex<float>, 1> t_of{};
        transfers.evaluate(place, mode, t_of);
        node.emplace_back(t_of[0]);
      }
      double error = 0.0, power = 0.0, state = 0.0, rms = 0.0;
      int rms_count = 0;
      for (const auto& t : node) rms += std::norm(t), ++rms_count;
      rms = std::sqrt(rms / rms_count);
      for (int n = 960; n < frames; ++n) {
        const double u = (n % 16) / 16.0;
        const std::size_t i = n / 16 + 2;
        const std::complex<double> a = node[i - 1], b = node[i], c = node[i + 1], d = node[i + 2];
        const std::complex<double> t = b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)));
        // Re(conj(T) v): v's real part by the monopole of 1; conj(i) v = -i v has the real part Im v.
        const double re = static_cast<double>(sound[1][n]) / spread, im = static_cast<double>(sound[2][n]) / spread;
        const double expected = t.real() * re + t.imag() * im;
        const double rest = static_cast<double>(sound[0][n]) - expected;
        error += rest * rest;
        power += expected * expected;
        state += re * re + im * im;
      }
      if (!(state > 0.0)) continue;
      power = std::max(power, 0.5 * state * rms * rms);
      const double error_db = 10.0 * std::log10(error / power + 1e-40);
      sum += error / power;
      ++count;
      const int own = transfers.get_order(m);
      if (own > 9) worst_high = std::max(worst_high, error_db);
      if (error_db > worst) worst = error_db, order = own;
    }
    std::printf("| %.0f | %d | %.1f | %.1f | %d | %.1f |\n", turn_rad_s, count, 10.0 * std::log10(sum / count), worst, order, worst_high);
  }
}

}  // namespace

int main(int argc, char** argv) {
  bool quick = false, error_only = false;
  std::string bank;
  for (int i = 1; i < argc; ++i) {
    quick = quick || std::strcmp(argv[i], "--quick") == 0;
    error_only = error_only || std::strcmp(argv[i], "--error") == 0;
    if (std::strcmp(argv[i], "--bank") == 0 && i + 1 < argc) bank = argv[++i];
  }
  try {
    std::optional<bank::Bank> given;
    if (!bank.empty()) given = bank::read_bank(bank);
    if (!error_only) measure_cost(nullptr, quick);
    if (!error_only && given) measure_cost(&*given, quick);
    measure_error(make_bank(1), "Random multipoles", quick);
    if (given) measure_error(*given, "The bank", quick);
  } catch (const InputError& error) {
    std::fprintf(stderr, "bench_turning: %s\n", error.what());
    return 1;
  }
  return 0;
}
