// Method: steps to positions and velocities at the audio rate, to volume accelerations of triangles, to arrivals at the receivers.
//   Triangles are evaluated once per sample. Except for kPaper2001 the nodes are filtered instead of eq. 5: a normal rotates far less per
//   step than its node moves per sample. a_n is d(v.S)/dt over the rest area, so that a closed surface radiates exactly its change of
//   volume.
// Source: OCE01 eq. 2 to 10; docs/equations.md E14.
#include "precompute/simulation/emission/emission.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "precompute/simulation/emission/loops.hpp"
#include "precompute/simulation/emission/motion_filter.hpp"
#include "precompute/simulation/emission/paper_filter.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/sources.hpp"
#include "precompute/simulation/emission/surface_file.hpp"
#include "precompute/simulation/emission/surfaces.hpp"
#include "precompute/simulation/emission/visibility.hpp"
#include "runtime/acoustics/recording/high_pass.hpp"
#include "runtime/base/error.hpp"

namespace carillon::emission {
namespace {

// Method: rays from every triangle to every receiver, 1000 times a second, at the positions of the beginning of a sample; delta is
//   interpolated in between.
// Source: OCE01 eq. 10; docs/equations.md E14.

/// Occlusion by silent surfaces, moving balls, walls and the sounding surfaces. Invariant: delta is the same on any number of ranks.
class Screens {
 public:
  /// Collective. options: as for Emission.
  Screens(const Surfaces& surfaces, const SurfacePart& part, const Options& options);

  /// Current positions [m].
  void set_balls(std::span<const Vec3> centres_m) { balls_.assign(centres_m.begin(), centres_m.end()); }
  /// Stores the positions of sample k, which begins with these displacements.
  void keep(std::int64_t k, const double* u);
  /// Casts the rays at sample k, x its positions, every 1/1000 s; no work at other samples. Collective.
  void look(std::int64_t k, const double* x);
  /// delta of a receiver at sample k, after look(k): `count` slots from the first on.
  void shade(std::int64_t k, std::size_t receiver, std::size_t first, std::size_t count, double* pa) const;

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(places_, before_, now_);
  }

 private:
  double* get_places(std::int64_t k) { return places_.data() + static_cast<std::size_t>(k) / every_ % ring_ * rows_; }

  const Surfaces& surfaces_;
  const Options& options_;
  std::vector<std::int32_t> node_;                      // caller's nodes, on this rank
  std::vector<double> rest_;                            // m
  std::vector<std::array<std::int64_t, 3>> triangles_;  // of all ranks, into the nodes of all ranks, concatenated by rank
  std::size_t every_, rows_, ring_;                     // samples between two visibility tests; numbers per row of places_; rows kept
  std::vector<Vec3> balls_;
  std::vector<double> places_;       // (ring_, rows_): nodes, then balls [m]
  std::vector<float> before_, now_;  // (receivers, slots) at the last two tests
};

constexpr std::size_t kTestsPerSecond = 1000;
constexpr std::size_t kMaxLagSamples = 64;  // largest lag between the step of a sample and its emission, in samples

Screens::Screens(const Surfaces& surfaces, const SurfacePart& part, const Options& options)
    : surfaces_(surfaces),
      options_(options),
      every_(std::max<std::size_t>(1, static_cast<std::size_t>(options.sample_rate_hz) / kTestsPerSecond)),
      ring_(kMaxLagSamples / every_ + 2),
      balls_(options.ball_radius_m.size()),
      before_(surfaces.get_slots() * options.receivers.size(), 1.0F),
      now_(before_) {
  std::vector<std::int64_t> numbers;
  std::set<std::int32_t> own;
  for (const Triangle& corner : part.silent) own.insert(corner.begin(), corner.end());
  for (const std::int32_t one : own) {
    node_.push_back(one);
    numbers.push_back(part.node_number[one]);
    for (const double x : part.nodes_m[one]) rest_.push_back(x);
  }
  std::vector<std::array<std::int64_t, 3>> triangles;
  for (const Triangle& corner : part.silent) {
    triangles.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) triangles.back()[c] = part.node_number[corner[c]];
  }
  triangles_ = surfaces_.comm.all_gather(triangles);
  std::map<std::int64_t, std::int64_t> place_of;
  const std::vector<std::int64_t> all = surfaces_.comm.all_gather(numbers);
  for (std::size_t i = 0; i < all.size(); ++i) place_of.try_emplace(all[i], static_cast<std::int64_t>(i));
  for (auto& corner : triangles_)
    for (std::int64_t& one : corner) one = place_of.at(one);
  rows_ = 3 * (node_.size() + balls_.size());
  places_.assign(ring_ * rows_, 0.0);
}

void Screens::keep(std::int64_t k, const double* u) {
  if (static_cast<std::size_t>(k) % every_ != 0) return;
  double* to = get_places(k);
  for (std::size_t s = 0; s < node_.size(); ++s)
    for (std::size_t axis = 0; axis < 3; ++axis) *to++ = rest_[3 * s + axis] + u[4 * node_[s] + axis];
  for (const Vec3& ball : balls_) to = std::copy(ball.begin(), ball.end(), to);
}

void Screens::look(std::int64_t k, const double* x) {
  if (static_cast<std::size_t>(k) % every_ != 0) return;
  const std::vector<Vec3> vertices = surfaces_.gather_vertices(x);
  std::vector<Corners> triangles;
  for (const Triangle& corner : surfaces_.tables.triangles) {
    const auto at = [&](std::size_t c) { return vertices[corner[c]]; };
    triangles.push_back({at(0), at(1), at(2)});
  }
  std::vector<job::RigidObstacle> walls = options_.walls;
  if (!triangles_.empty()) {
    std::vector<Vec3> screen;
    for (std::size_t s = 0; s < node_.size(); ++s) screen.push_back(get_vertex(get_places(k), static_cast<std::int32_t>(3 * s)));
    screen = surfaces_.comm.all_gather(screen);
    const auto at = [&](std::int64_t s) { return screen[s]; };
    for (const auto& corner : triangles_) triangles.push_back({at(corner[0]), at(corner[1]), at(corner[2])});
  }
  for (std::size_t b = 0; b < balls_.size(); ++b)
    walls.push_back(
        job::BallObstacle{get_vertex(get_places(k), static_cast<std::int32_t>(3 * (node_.size() + b))), options_.ball_radius_m[b]});
  const Visibility visibility(triangles);
  before_ = now_;
  for (std::size_t t = 0; t < surfaces_.get_slots(); ++t) {
    if (surfaces_.place[t] < 0) continue;
    const Corners& corner = triangles[surfaces_.place[t]];
    const Vec3 centre = (1.0 / 3.0) * (corner[0] + corner[1] + corner[2]);
    const Vec3 out = cross(corner[1] - corner[0], corner[2] - corner[0]);
    for (std::size_t i = 0; i < options_.receivers.size(); ++i) {
      // A side that faces away is hidden by its own body; for a sheet, by its other side in the same plane.
      const Vec3& ear = options_.receivers[i].place_m;
      const bool is_seen = dot(out, ear - centre) > 0.0 &&
                           std::none_of(walls.begin(), walls.end(), [&](const auto& wall) { return is_between(wall, centre, ear); }) &&
                           visibility.is_free(centre, ear, surfaces_.place[t]);
      now_[i * surfaces_.get_slots() + t] = is_seen ? 1.0F : 0.0F;
    }
  }
  if (k == 0) before_ = now_;
}

void Screens::shade(std::int64_t k, std::size_t receiver, std::size_t first, std::size_t count, double* pa) const {
  const double fade = std::min(1.0, static_cast<double>(static_cast<std::size_t>(k) % every_) / static_cast<double>(every_));
  const std::size_t at = receiver * surfaces_.get_slots() + first;
  for (std::size_t i = 0; i < count; ++i) {
    const auto before = static_cast<double>(before_[at + i]), now = static_cast<double>(now_[at + i]);
    pa[i] *= before + fade * (now - before);
  }
}

// Method: whole blocks of samples, and keys, are gathered from all ranks and written by rank 0. docs/surface-format.md.

/// Writes triangle accelerations in blocks of samples and vertex positions at keys, of all ranks, to the file of rank 0. All calls are
/// collective and throw SystemError on all ranks for write errors.
class Recorder {
 public:
  /// options: as for Emission, with a file. Throws InputError as SurfaceFile does.
  Recorder(const Surfaces& surfaces, const Options& options);

  /// Sample k; x: rows. False for a number that is not finite or too large, recorded as 0.
  bool record(std::int64_t k, const double* x, Sources& sources);
  bool is_whole() const { return keys_written_ >= static_cast<std::int64_t>(header_.count_keys()); }
  /// On rank 0.
  void commit() {
    if (file_) file_->commit();
  }

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(keys_written_, block_);
  }

 private:
  void write_block(std::uint64_t number, bool& is_fine);
  void write_key(std::uint64_t key, const double* x, bool& is_fine);

  const Surfaces& surfaces_;
  recording::Header header_;
  std::unique_ptr<SurfaceFile> file_;  // rank 0
  std::int64_t keys_written_ = 0;
  std::vector<float> block_;  // (own triangles, kBlockFrames): accelerations of the open block
};

Recorder::Recorder(const Surfaces& surfaces, const Options& options) : surfaces_(surfaces) {
  const double fs = options.sample_rate_hz;
  header_.sample_rate_hz = fs;
  header_.air_density_kg_m3 = options.air_density_kg_m3;
  header_.sound_speed_m_s = options.sound_speed_m_s;
  header_.frames = options.frames;
  header_.key_frames = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(fs / options.keep_hz)));
  header_.vertices = surfaces.vertex_total;
  header_.triangles = surfaces.triangle_total;
  header_.bodies = surfaces.tables.radius_m.size();
  surfaces.comm.agree([&] {
    const auto own = std::count_if(surfaces.place.begin(), surfaces.place.end(), [](std::int64_t one) { return one >= 0; });
    block_.assign(static_cast<std::size_t>(own) * recording::kBlockFrames, 0.0F);
    if (surfaces.comm.is_root()) file_ = std::make_unique<SurfaceFile>(options.surface_file, header_, surfaces.tables, options.is_resumed);
  });
}

bool Recorder::record(std::int64_t k, const double* x, Sources& sources) {
  const auto frame = static_cast<std::uint64_t>(k);
  bool is_fine = true;
  if (frame < header_.frames) {
    const std::size_t at = frame % recording::kBlockFrames;
    std::size_t own = 0;
    for (std::size_t begin = 0; begin < surfaces_.get_slots(); begin += kLane) {
      const double* source = sources.get(begin, k).data;
      for (std::size_t t = begin; t < begin + kLane; ++t)
        if (surfaces_.place[t] >= 0)
          block_[own++ * recording::kBlockFrames + at] = static_cast<float>(source[t - begin] / surfaces_.area[t]);
    }
    if (at + 1 == recording::kBlockFrames || frame + 1 == header_.frames) write_block(frame / recording::kBlockFrames, is_fine);
  }
  if (frame % header_.key_frames == 0 && frame / header_.key_frames < header_.count_keys())
    write_key(frame / header_.key_frames, x, is_fine);
  return is_fine;
}

void Recorder::write_block(std::uint64_t number, bool& is_fine) {
  const std::size_t own = block_.size() / recording::kBlockFrames;
  std::vector<float> scale(own, 0.0F);
  std::vector<std::int16_t> value(block_.size());
  for (std::size_t t = 0; t < own; ++t) {
    const auto row = std::span(block_).subspan(t * recording::kBlockFrames, recording::kBlockFrames);
    float most = 0.0F;
    for (float& one : row) {
      if (!(std::abs(one) <= 1e12F)) {
        is_fine = false;
        one = 0.0F;
      }
      most = std::max(most, std::abs(one));
    }
    scale[t] = most / 32767.0F;
    for (std::size_t i = 0; i < row.size(); ++i)
      value[t * recording::kBlockFrames + i] =
          scale[t] > 0.0F ? static_cast<std::int16_t>(std::clamp(std::lrint(row[i] / scale[t]), -32767L, 32767L)) : std::int16_t{0};
  }
  std::fill(block_.begin(), block_.end(), 0.0F);
  const auto scales = surfaces_.comm.all_gather(scale);
  const auto values = surfaces_.comm.all_gather(value);
  surfaces_.comm.agree([&] {
    if (!surfaces_.comm.is_root()) return;
    std::vector<float> all_scales(surfaces_.triangle_total);
    std::vector<std::int16_t> all_values(surfaces_.triangle_total * recording::kBlockFrames);
    for (std::size_t i = 0; i < scales.size(); ++i) {
      const std::size_t at = surfaces_.gathered_places[i];
      all_scales[at] = scales[i];
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i * recording::kBlockFrames), recording::kBlockFrames,
                  all_values.begin() + static_cast<std::ptrdiff_t>(at * recording::kBlockFrames));
    }
    file_->write_block(number, all_scales, all_values);
  });
}

void Recorder::write_key(std::uint64_t key, const double* x, bool& is_fine) {
  std::vector<Vec3> vertices = surfaces_.gather_vertices(x);
  for (Vec3& vertex : vertices)
    for (double& one : vertex)
      if (!(std::abs(one) <= 1e6)) {
        is_fine = false;
        one = 0.0;
      }
  surfaces_.comm.agree([&] {
    if (file_) file_->write_key(key, vertices);
  });
  keys_written_ = static_cast<std::int64_t>(key) + 1;
}

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
