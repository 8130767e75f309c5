// Method: steps to positions and velocities at the audio rate, to volume accelerations of triangles, to arrivals at the receivers.
//   Triangles are evaluated once per sample. Except for kPaper2001 the nodes are filtered instead of eq. 5: a normal rotates far less per
//   step than its node moves per sample. a_n is d(v.S)/dt over the rest area, so that a closed surface radiates exactly its change of
//   volume.
// Source: OCE01 eq. 2 to 10; docs/equations.md E14.
#include "precompute/simulation/emission/emission.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>

#include "precompute/simulation/emission/loops.hpp"
#include "precompute/simulation/emission/motion_filter.hpp"
#include "precompute/simulation/emission/paper_filter.hpp"
#include "precompute/simulation/emission/recorder.hpp"
#include "precompute/simulation/emission/screens.hpp"
#include "precompute/simulation/emission/sources.hpp"
#include "precompute/simulation/emission/surfaces.hpp"
#include "runtime/acoustics/recording/high_pass.hpp"
#include "runtime/base/error.hpp"

namespace carillon::emission {
namespace {

Options check(Options options) {
  if (const double fs = options.sample_rate_hz; !(fs >= 8000.0 && fs <= 1e6))
    throw InputError(fmt::format("a sample rate of {} Hz cannot be used; give 8,000 to 1,000,000 Hz", fs));
  if (options.frames == 0 || options.frames > 1000000000) throw InputError("the sound has no samples, or more than 1e9; change duration_s");
  if (options.surface_file.empty()) return options;
  if (options.radiation == Radiation::kPaper2001)
    throw InputError("a recorded surface cannot be made with radiation paper2001; choose kirchhoff or leave out \"surface\"");
  if (!(options.keep_hz >= 1.0 && options.keep_hz <= options.sample_rate_hz)) throw InputError("keep_hz must be 1 Hz to the sample rate");
  return options;
}

}  // namespace

using recording::calc_alpha;
using recording::HighPass;

int find_steps(int least) {
  for (const int grain : {16, 8, 4}) {
    const int steps = (least + grain - 1) / grain * grain;
    if (grain == 4 || (steps - least) * 100 <= 7 * least) return std::max(steps, 4);
  }
  return least;
}

struct Emission::State {
  State(const comm::Communicator& communicator, const SurfacePart& part, Options wanted);

  void set_rate(int steps_per_sample);
  void add_step(const double* u);
  void take_batch(std::int64_t first);
  void emit(std::int64_t k, const double* x, Frames source, const double* poles);
  void finish();
  template <typename Visit>
  void visit_state(Visit&& visit);

  comm::Communicator comm;
  Options options;
  const RowLoops* loops = &find_loops();
  double alpha = 0.0;
  Surfaces surfaces;
  std::vector<std::int64_t> counts;  // (blocks): triangles, without padding
  std::vector<Ear> ears;

  // Filter chain: the first two, or the third.
  std::optional<MotionFilter> motion;
  std::optional<Sources> sources;
  std::optional<PaperFilter> paper;
  std::optional<Screens> screens;    // for formulas with delta, unless disabled
  std::optional<Recorder> recorder;  // only with a surface file
  std::vector<HighPass> blockers;    // (slots); empty with kKirchhoff
  std::vector<Arrivals> arrivals;    // (receivers)

  int steps = 0;              // per sample
  std::int64_t step = 0;      // of this sample, so far
  std::int64_t samples = 0;   // before this one
  std::uint64_t emitted = 0;  // samples
  bool is_finished = false, has_fault = false;
};

Emission::State::State(const comm::Communicator& communicator, const SurfacePart& part, Options wanted)
    : comm(communicator), options(comm.agree([&] { return check(std::move(wanted)); })), surfaces(comm, part) {
  const double fs = options.sample_rate_hz;
  const bool is_kirchhoff = options.radiation == Radiation::kKirchhoff, is_printed = options.radiation == Radiation::kPaper2001;
  alpha = is_printed && !options.high_pass_hz ? kAlpha2001 : calc_alpha(options.high_pass_hz.value_or(20.0), fs);
  comm.agree([&] {
    for (std::size_t begin = 0; begin < surfaces.get_slots(); begin += kLane)
      counts.push_back(std::count_if(surfaces.place.begin() + static_cast<std::ptrdiff_t>(begin),
                                     surfaces.place.begin() + static_cast<std::ptrdiff_t>(begin + kLane),
                                     [](std::int64_t one) { return one >= 0; }));
    for (const Microphone& one : options.receivers)
      ears.push_back({{one.place_m[0], one.place_m[1], one.place_m[2]}, {one.axis[0], one.axis[1], one.axis[2]}, one.directivity});
    if (!is_kirchhoff) blockers.assign(surfaces.get_slots(), {});
    arrivals.assign(options.receivers.size(), Arrivals(static_cast<std::size_t>(options.frames)));
    if (!is_printed) {
      motion.emplace(surfaces, options.frames, [this](std::int64_t first) { take_batch(first); });
      sources.emplace(surfaces, fs, options.sound_speed_m_s, is_kirchhoff, !is_kirchhoff || !options.surface_file.empty());
    }
    set_rate(options.steps_per_sample);
  });
  if (options.has_visibility && !is_kirchhoff) screens.emplace(surfaces, part, options);  // also on ranks without triangles
  if (!options.surface_file.empty()) recorder.emplace(surfaces, options);
}

void Emission::State::set_rate(int steps_per_sample) {
  const bool is_printed = options.radiation == Radiation::kPaper2001;
  if (steps_per_sample < 1 || (!is_printed && steps_per_sample % 4 != 0))
    throw InputError(
        fmt::format("{} steps a sample cannot be filtered; take {}", steps_per_sample, find_steps(std::max(1, steps_per_sample))));
  steps = steps_per_sample;
  if (motion) {
    motion->set_rate(steps);
  } else if (!paper) {
    paper.emplace(surfaces, options.sample_rate_hz, steps, options.air_density_kg_m3 * options.sound_speed_m_s, [this](std::int64_t k) {
      if (k >= 0) emit(k, paper->get_places(), {paper->get_pressures(), kLane}, nullptr);
    });
  }
}

void Emission::State::add_step(const double* u) {
  if (emitted >= options.frames) return;
  if (step == steps) {
    step = 0;
    ++samples;
  }
  if (step++ == 0 && screens) screens->keep(samples, u);
  if (motion) {
    motion->add_step(u);
  } else {
    paper->add_step(u);
  }
}

/// Positions and velocities from sample `first` on.
void Emission::State::take_batch(std::int64_t first) {
  const std::optional<std::int64_t> now = sources->calc(*motion, first);
  if (!now) return;
  for (std::int64_t k = *now; k < *now + kBatch; ++k) {
    emit(k, motion->get_places(k), sources->get(0, k), blockers.empty() ? sources->get_poles(k) : nullptr);
    if (recorder && !recorder->record(k, motion->get_places(k), *sources)) has_fault = true;
  }
}

/// Sends sample k to the receivers. source: slots; poles: (slots), with kKirchhoff.
void Emission::State::emit(std::int64_t k, const double* x, Frames source, const double* poles) {
  if (static_cast<std::uint64_t>(k) >= options.frames) return;
  emitted = static_cast<std::uint64_t>(k) + 1;
  if (screens) screens->look(k, x);
  const double per_speed = 2.0 * options.sample_rate_hz / options.sound_speed_m_s;  // half-samples per metre
  const double share = options.air_density_kg_m3 / (4.0 * std::numbers::pi);
  Facets facets;
  alignas(64) double plain[kLane], turned[kLane], time[kLane], pa[kLane];  // omnidirectional part; part times the cosine
  for (std::size_t r = 0; r < surfaces.runs.size(); ++r) {
    const Surfaces::Run& run = surfaces.runs[r];
    for (std::size_t begin = run.begin; begin < (poles ? run.middle : run.end); begin += kLane) {
      const std::size_t count = counts[begin / kLane];
      if (count == 0) continue;
      const double* from = source.data + begin / kLane * source.stride;
      loops->find_facets(x, surfaces.corners[begin].data(), &facets);
      std::fill(std::begin(plain), std::end(plain), 0.0);
      std::fill(std::begin(turned), std::end(turned), 0.0);
      if (options.radiation == Radiation::kKirchhoff) {
        // For the two sides of a sheet the monopoles cancel, and the dipoles are equal.
        for (std::size_t i = 0; i < count; ++i) {
          const bool is_pair = surfaces.has_twin[begin + i];
          plain[i] = is_pair ? 0.0 : share * from[i];
          turned[i] = (is_pair ? 2.0 : 1.0) * share * (from[i] - sources->get_pole_rate(r) * poles[begin + i]);
        }
      } else if (options.radiation == Radiation::kRayleigh) {
        for (std::size_t i = 0; i < count; ++i) plain[i] = 2.0 * share * blockers[begin + i].next(from[i], alpha);
      } else {
        for (std::size_t i = 0; i < count; ++i) turned[i] = 0.5 * facets.twice_area[i] * blockers[begin + i].next(from[i], alpha);
      }
      for (std::size_t i = 0; i < arrivals.size(); ++i) {
        loops->radiate(&facets, &ears[i], per_speed, plain, turned, time, pa);
        if (screens) screens->shade(k, i, begin, count, pa);
        if (!arrivals[i].add(k, std::span(time, count), pa)) has_fault = true;
      }
    }
  }
}

void Emission::State::finish() {
  comm.agree([&] {
    if (is_finished) throw SolveError("the sound was finished before");
    const std::int64_t there = samples + (step > 0 ? 1 : 0);
    if (motion && !motion->has_speed()) throw SolveError("the sound has no two steps");
    if (emitted < options.frames && there < static_cast<std::int64_t>(options.frames))
      throw SolveError(fmt::format("{} samples of {} were simulated; finish the run first", there, options.frames));
  });
  is_finished = true;
  const auto is_done = [&] { return emitted >= options.frames && (!recorder || recorder->is_whole()); };
  if (motion) {
    motion->finish(is_done);
  } else {
    paper->finish(is_done);
  }
  comm.agree([&] {
    if (has_fault)
      throw SolveError("a surface makes more than 1e4 Pa, or moves by a non-finite value: the motion is not stable; take a shorter step");
    if (recorder) recorder->commit();
  });
}

template <typename Visit>
void Emission::State::visit_state(Visit&& visit) {
  visit(steps, step, samples, has_fault, emitted, blockers);  // load() reads the first one separately
  if (motion) motion->visit_state(visit);
  if (sources) sources->visit_state(visit);
  if (paper) paper->visit_state(visit);
  if (screens) screens->visit_state(visit);
  if (recorder) recorder->visit_state(visit);
  for (Arrivals& one : arrivals) one.visit_state(visit);
}

Emission::Emission(const comm::Communicator& comm, const SurfacePart& part, Options options)
    : state_(std::make_unique<State>(comm, part, std::move(options))) {}
Emission::~Emission() = default;

void Emission::add_step(const double* displacement_m) { state_->add_step(displacement_m); }
void Emission::set_balls(std::span<const Vec3> centres_m) {
  if (state_->screens) state_->screens->set_balls(centres_m);
}
bool Emission::has_fault() const { return state_->has_fault; }
bool Emission::is_at_sample() const { return state_->step == 0 || state_->step == state_->steps; }
void Emission::finish() { state_->finish(); }

void Emission::set_steps_per_sample(int steps) {
  if (steps == state_->steps) return;
  if (state_->paper) throw InputError("with radiation paper2001 the step cannot change during a run");
  if (!is_at_sample() || !state_->motion->has_speed()) throw InputError("the step can only change at the beginning of a sample");
  state_->set_rate(steps);
  state_->step = 0;
  ++state_->samples;
}

std::vector<double> Emission::calc_sound(std::size_t receiver) const {
  auto sound = state_->arrivals[receiver].sum(state_->comm);
  if (state_->options.radiation != Radiation::kKirchhoff) return sound;
  HighPass blocker;
  for (double& one : sound) one = blocker.next(one, state_->alpha);
  return sound;
}

std::vector<std::byte> Emission::save() const {
  std::vector<std::byte> bytes;
  state_->visit_state(Saver{bytes});
  return bytes;
}

void Emission::load(std::span<const std::byte> bytes) {
  std::span<const std::byte> front = bytes;
  if (state_->motion) state_->set_rate(base::take<int>(front));
  state_->visit_state(Loader{bytes});
  if (!bytes.empty()) throw InputError("the state of the sound is too long; remove the checkpoint and run again");
}

}  // namespace carillon::emission
