// One chain from displacements to sound, whose stages share the rows of nodes and triangles; longer than most files.
// Method:     displacements are summed over a box of steps; a low-pass takes the means to the audio rate; velocities and accelerations are
//             band-limited derivatives there (33 samples). A box is a mean of places: the velocity that follows has passed it twice, as
//             the difference and as the mean, which sets its images to -60 dB. Triangles are evaluated once a sample.
// Source:     OCE01 eq. 2 to 10; docs/equations.md E14.
// Deviations: but for kPaper2001 the nodes are filtered instead of eq. 5: what a normal does within a step is far below what its motion
//             does within a sample. a_n is d(v.S)/dt over the area at rest, so that a closed surface radiates its change of volume
//             exactly.
#include "precompute/emission/emission.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <numeric>

#include "precompute/emission/derivative.hpp"
#include "precompute/emission/loops.hpp"
#include "precompute/emission/low_pass.hpp"
#include "precompute/emission/surface_file.hpp"
#include "runtime/base/bytes.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sinc.hpp"
#include "runtime/recording/high_pass.hpp"
#include "runtime/recording/pole.hpp"

namespace carillon::emission {
namespace {

using recording::calc_alpha;
using recording::HighPass;

constexpr int kLeast = 16;                                              // boxes in a sample: images at -60 dB
constexpr int kPlaceRing = 64;                                          // samples of places that are kept
constexpr int kSourceRing = recording::kPoleTaps + kBatch;              // of volume accelerations
constexpr int kPoleAhead = recording::kPoleTaps / 2;                    // samples that the pole looks ahead
constexpr int kBefore = kPoleAhead + kDerivativeHalf + LowPass::kHalf;  // intervals of uniform motion before the first step
constexpr std::uint64_t kRayRate = 1000;                                // Hz

std::size_t round_up(std::size_t n) { return (n + kLane - 1) / kLane * kLane; }

/// Steps in a box.
int find_box(int steps) {
  for (int box = steps / kLeast; box > 1; --box)
    if (steps % box == 0) return box;
  return 1;
}

/// A number of all ranks, and where its item was.
struct Gathered {
  std::int64_t number;
  std::int32_t body;
  std::array<std::int64_t, 3> nodes;
  double area_m2;
};

struct Saver {
  std::vector<std::byte>& to;
  template <typename T>
  void one(const T& value) {
    base::put(to, value);
  }
  template <typename T>
  void list(const std::vector<T>& values) {
    base::put_list(to, values);
  }
};

struct Loader {
  std::span<const std::byte>& from;
  template <typename T>
  void one(T& value) {
    value = base::take<T>(from);
  }
  template <typename T>
  void list(std::vector<T>& values) {
    base::take_list(from, values);
  }
};

Vec3 get_vertex(const double* places, std::int32_t vertex) {
  const double* at = places + 3 * static_cast<std::size_t>(vertex);
  return {at[0], at[1], at[2]};
}

}  // namespace

int find_steps(int least) {
  for (const int grain : {16, 8, 4}) {
    const int steps = (least + grain - 1) / grain * grain;
    if (grain == 4 || (steps - least) * 100 <= 7 * least) return std::max(steps, 4);
  }
  return least;
}

struct Emission::State {
  State(const comm::Communicator& communicator, SurfacePart given, Options wanted);

  // ---- what does not change ----
  comm::Communicator comm;
  Options options;
  const RowLoops* loops = &find_loops();
  bool is_paper = false;
  bool has_delta = false;  // the formula has it, and it is wanted
  double alpha = 0.0;
  std::vector<std::int32_t> node;   // (V) of the caller, each vertex of the triangles once
  std::vector<double> rest;         // (3 V, padded) m
  std::vector<Triangle> corners;    // (slots): vertices; triangles by body, each body padded to lanes
  std::vector<std::int64_t> place;  // (slots) among the triangles of all ranks by their numbers; -1: padding
  std::vector<double> area;         // (slots) at rest, m2
  std::vector<std::int32_t> twin;   // (slots) the same triangle seen from its other side, which is no twin; -1: none
  std::vector<bool> is_whole;       // (slots) such a one follows: kKirchhoff emits both at once
  struct Run {
    std::size_t begin, middle, end;  // slots; from the middle on twins
    recording::Pole pole;
  };
  std::vector<Run> runs;
  std::vector<std::int64_t> gathered_places;  // of the triangles that ranks send, in the order of the ranks
  std::vector<std::int64_t> vertex_place;     // (V) among the vertices of all ranks
  std::vector<std::int64_t> gathered_vertices;
  std::size_t vertex_total = 0, triangle_total = 0;
  std::uint64_t key_frames = 48, ray_frames = 48;
  Derivative derivative = make_derivative();
  std::unique_ptr<SurfaceFile> file;  // rank 0
  SurfaceTables tables;
  recording::Header header;
  // What makes no sound and hides others; none without delta.
  std::vector<std::int32_t> screen_node;             // of the caller, on this rank
  std::vector<double> screen_rest;                   // m
  std::vector<std::array<std::int64_t, 3>> screens;  // triangles of all ranks, into the screen nodes of all ranks, one rank behind another
  std::size_t screen_rows = 0;                       // numbers of a row of `screen_places`
  std::size_t screen_ring = 0;                       // rows that are kept, one every ray_frames samples

  // ---- the rate ----
  int steps = 0, box = 1;
  void set_rate(int steps_per_sample);

  // ---- what changes ----
  std::int64_t step_in_sample = 0;  // steps of this interval that have come
  int in_box = 0;
  std::int64_t interval = 0;  // between which samples
  bool is_finished = false, has_fault = false, has_last = false;
  std::int32_t keys_written = 0;
  std::uint64_t emitted = 0;
  std::vector<double> sum;                    // (V, 4): displacements of the steps in the box
  std::vector<double> first_mean, last_mean;  // (3 V, padded)
  std::int32_t means = 0;                     // boxes that came, up to 2
  std::vector<double> last_step;              // (3 V): displacements one step before; of kPaper2001 alone
  std::unique_ptr<LowPass> places_filter, pressure_filter;
  std::vector<double> places;                // (kPlaceRing, 3 V padded) m
  std::vector<double> sources;               // (kSourceRing, slots): volume accelerations [m3/s2]; kPaper2001: pressure [Pa]
  std::vector<double> pole;                  // (slots) of the next sample that leaves
  std::vector<HighPass> blockers;            // (slots)
  std::vector<float> seen_before, seen_now;  // (receivers, slots)
  std::int64_t samples = 0;                  // whose first step has come; counted where there is delta
  std::vector<Vec3> balls;                   // their centres now
  std::vector<double> screen_places;         // (screen_ring, screen_rows): screen nodes, then balls [m]
  std::vector<Arrivals> arrivals;            // (receivers)
  std::vector<float> block;                  // (own triangles, kBlockFrames): accelerations of the block that is open

  // ---- room for work ----
  std::vector<double> mean, pressure;
  std::vector<double> velocity, acceleration;  // (kBatch, rows)
  std::vector<double> next_poles;              // (kBatch, slots)
  std::vector<const double*> frames;

  std::size_t get_rows() const { return rest.size(); }
  double* get_places(std::int64_t k) {
    return places.data() + static_cast<std::size_t>((k % kPlaceRing + kPlaceRing) % kPlaceRing) * get_rows();
  }
  double* get_sources(std::int64_t k) {
    return sources.data() + static_cast<std::size_t>((k % kSourceRing + kSourceRing) % kSourceRing) * corners.size();
  }

  void add_step(const double* u);
  void take_mean();
  void add_mean(const double* value);
  void begin_uniform();
  void feed(const double* value);
  void add_pressures(const double* u);
  void close_interval();
  void take_sample(std::int64_t k);
  void calc_sources(std::int64_t first);
  void emit(std::int64_t k, const double* poles);
  void calc_poles(std::int64_t first);
  void gather_screens(const SurfacePart& part);
  double* get_screens(std::int64_t k) {
    return screen_places.data() + static_cast<std::size_t>(k) / ray_frames % screen_ring * screen_rows;
  }
  void keep_screens(const double* u);
  void look(std::int64_t k);
  void record(std::int64_t k);
  void write_block(std::uint64_t number);
  void write_key(std::uint64_t key, std::int64_t k);
  void finish();
  template <typename Visit>
  void visit_state(Visit&& visit);
};

Emission::State::State(const comm::Communicator& communicator, SurfacePart part, Options wanted)
    : comm(communicator), options(std::move(wanted)) {
  is_paper = options.radiation == Radiation::kPaper2001;
  has_delta = options.has_visibility && options.radiation != Radiation::kKirchhoff;  // on ranks without triangles, too
  const double fs = options.sample_rate_hz;
  comm.agree([&] {
    const std::size_t nodes = part.nodes_m.size();
    if (!(fs >= 8000.0 && fs <= 1e6))
      throw InputError(fmt::format("a sample rate of {} Hz cannot be used; give 8,000 to 1,000,000 Hz", fs));
    if (options.frames == 0 || options.frames > 1000000000)
      throw InputError("the sound has no samples, or more than 1e9; change duration_s");
    if (part.node_number.size() != nodes || part.triangle_number.size() != part.triangles.size() ||
        part.body.size() != part.triangles.size())
      throw InputError("lists of nodes or triangles of a surface have different lengths");
    for (const Triangle& corner : part.triangles)
      for (const std::int32_t one : corner)
        if (one < 0 || static_cast<std::size_t>(one) >= nodes) throw InputError("a triangle of a surface names a node that is not there");
    for (const Triangle& corner : part.silent)
      for (const std::int32_t one : corner)
        if (one < 0 || static_cast<std::size_t>(one) >= nodes) throw InputError("a silent triangle names a node that is not there");
    if (options.surface_file.empty()) return;
    if (is_paper) throw InputError("a recorded surface cannot be made with radiation paper2001; choose kirchhoff or leave out \"surface\"");
    if (!(options.keep_hz >= 1.0 && options.keep_hz <= fs)) throw InputError("keep_hz must be 1 Hz to the sample rate");
  });
  alpha = is_paper && !options.high_pass_hz ? kAlpha2001 : calc_alpha(options.high_pass_hz.value_or(20.0), fs);
  key_frames = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(fs / options.keep_hz)));
  ray_frames = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(fs) / kRayRate);

  // Vertices: the nodes that triangles have, in their order.
  std::vector<std::int32_t> vertex_of(part.nodes_m.size(), -1);
  for (const Triangle& corner : part.triangles)
    for (const std::int32_t one : corner) vertex_of[static_cast<std::size_t>(one)] = 0;
  for (std::size_t i = 0; i < vertex_of.size(); ++i)
    if (vertex_of[i] == 0) {
      vertex_of[i] = static_cast<std::int32_t>(node.size());
      node.push_back(static_cast<std::int32_t>(i));
    }
  rest.assign(std::max(kLane, round_up(3 * node.size())), 0.0);
  for (std::size_t v = 0; v < node.size(); ++v)
    for (std::size_t axis = 0; axis < 3; ++axis) rest[3 * v + axis] = part.nodes_m[static_cast<std::size_t>(node[v])][axis];

  // What all ranks know of all triangles.
  auto all = comm.all_gather([&] {
    std::vector<Gathered> own;
    for (std::size_t t = 0; t < part.triangles.size(); ++t) {
      const auto at = [&](std::size_t c) { return static_cast<std::size_t>(part.triangles[t][c]); };
      const Vec3& a = part.nodes_m[at(0)];
      own.push_back({part.triangle_number[t],
                     part.body[t],
                     {part.node_number[at(0)], part.node_number[at(1)], part.node_number[at(2)]},
                     0.5 * norm(cross(part.nodes_m[at(1)] - a, part.nodes_m[at(2)] - a))});
    }
    return own;
  });
  std::sort(all.begin(), all.end(), [](const Gathered& a, const Gathered& b) { return a.number < b.number; });
  triangle_total = all.size();
  std::vector<std::int64_t> numbers;
  std::vector<double> body_area;
  for (const Gathered& one : all) {
    if (!numbers.empty() && numbers.back() == one.number)
      throw InputError(fmt::format("triangle {} is on two ranks, or there twice", one.number));
    if (one.body < 0 || one.body > 1000000)
      throw InputError(fmt::format("triangle {} is of body {}, which cannot be", one.number, one.body));
    if (!(one.area_m2 > 0.0)) throw InputError(fmt::format("triangle {} of a surface has no area; repair the mesh", one.number));
    numbers.push_back(one.number);
    body_area.resize(std::max(body_area.size(), static_cast<std::size_t>(one.body) + 1), 0.0);
    body_area[static_cast<std::size_t>(one.body)] += one.area_m2;
  }
  if (numbers.empty()) throw InputError("no surface sounds; set \"sounds\" of a body");
  const auto find_place = [](const std::vector<std::int64_t>& list, std::int64_t number) {
    return std::lower_bound(list.begin(), list.end(), number) - list.begin();
  };
  std::vector<std::int64_t> vertices;
  for (const Gathered& one : all) vertices.insert(vertices.end(), one.nodes.begin(), one.nodes.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  vertex_total = vertices.size();
  tables.vertex_body.assign(vertex_total, 0);
  for (const Gathered& one : all) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) {
      corner[c] = static_cast<std::int32_t>(find_place(vertices, one.nodes[c]));
      tables.vertex_body[static_cast<std::size_t>(corner[c])] = one.body;
    }
    tables.triangles.push_back(corner);
    tables.triangle_body.push_back(one.body);
    tables.area_m2.push_back(one.area_m2);
  }
  for (const double whole : body_area) tables.radius_m.push_back(std::sqrt(std::max(whole, 1e-12) / (4.0 * std::numbers::pi)));
  for (const std::int32_t one : node) vertex_place.push_back(find_place(vertices, part.node_number[static_cast<std::size_t>(one)]));
  gathered_vertices = comm.all_gather(vertex_place);

  // Own triangles, body after body.
  std::vector<std::size_t> order(part.triangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(part.body[a], part.triangle_number[a]) < std::pair(part.body[b], part.triangle_number[b]);
  });
  const auto add_slot = [&](std::size_t t, std::int32_t of_twin) {
    Triangle corner;
    for (std::size_t c = 0; c < 3; ++c) corner[c] = vertex_of[static_cast<std::size_t>(part.triangles[t][c])];
    corners.push_back(corner);
    place.push_back(find_place(numbers, part.triangle_number[t]));
    area.push_back(tables.area_m2[static_cast<std::size_t>(place.back())]);
    twin.push_back(of_twin);
  };
  const auto pad = [&] {
    const std::size_t end = round_up(corners.size());
    corners.resize(end, Triangle{});
    place.resize(end, -1);
    area.resize(end, 0.0);
    twin.resize(end, -1);
    return end;
  };
  for (std::size_t i = 0; i < order.size();) {
    const std::int32_t body = part.body[order[i]];
    Run run{corners.size(), 0, 0, recording::make_pole(tables.radius_m[static_cast<std::size_t>(body)], fs, options.sound_speed_m_s)};
    // Of the two sides of a thin sheet the second one is behind all others.
    std::map<Triangle, std::size_t> sides;  // corners from the lowest on, slot
    std::vector<std::pair<std::size_t, std::int32_t>> second;
    for (; i < order.size() && part.body[order[i]] == body; ++i) {
      Triangle turned = part.triangles[order[i]];
      std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
      if (const auto other = sides.find({turned[0], turned[2], turned[1]}); other != sides.end()) {
        second.emplace_back(order[i], static_cast<std::int32_t>(other->second));
        sides.erase(other);
        continue;
      }
      sides.emplace(turned, corners.size());
      add_slot(order[i], -1);
    }
    run.middle = pad();
    for (const auto& [t, of_twin] : second) add_slot(t, of_twin);
    run.end = pad();
    runs.push_back(run);
  }
  is_whole.assign(corners.size(), false);
  for (const std::int32_t one : twin)
    if (one >= 0) is_whole[static_cast<std::size_t>(one)] = true;

  std::vector<std::int64_t> own_places;
  for (const std::int64_t one : place)
    if (one >= 0) own_places.push_back(one);
  gathered_places = comm.all_gather(own_places);

  const std::size_t rows = get_rows(), slots = corners.size();
  comm.agree([&] {
    sum.assign(4 * node.size(), 0.0);
    first_mean.assign(rows, 0.0);
    last_mean = mean = first_mean;
    velocity.assign(rows * kBatch, 0.0);
    acceleration = velocity;
    next_poles.assign(slots * kBatch, 0.0);
    if (is_paper) last_step = first_mean;
    places_filter = std::make_unique<LowPass>(rows, is_paper ? Kernel::kHann2001 : Kernel::kFlat);
    if (is_paper) pressure_filter = std::make_unique<LowPass>(slots, Kernel::kHann2001);
    places.assign(rows * kPlaceRing, 0.0);
    for (int k = 0; k < kPlaceRing; ++k) std::copy(rest.begin(), rest.end(), get_places(k));
    sources.assign(slots * kSourceRing, 0.0);
    pole.assign(slots, 0.0);
    pressure.assign(slots, 0.0);
    if (options.radiation != Radiation::kKirchhoff) {
      blockers.assign(slots, {});
      if (has_delta) seen_before.assign(slots * options.receivers.size(), 1.0F);
      seen_now = seen_before;
    }
    arrivals.assign(options.receivers.size(), Arrivals(static_cast<std::size_t>(options.frames)));
    if (!options.surface_file.empty()) block.assign(own_places.size() * recording::kBlockFrames, 0.0F);
    frames.resize(2 * kDerivativeHalf + kBatch);
    set_rate(options.steps_per_sample);
    interval = is_paper ? 0 : -kBefore;
    base::Sinc::get();
  });

  if (has_delta) gather_screens(part);
  if (options.surface_file.empty()) return;
  header.sample_rate_hz = fs;
  header.air_density_kg_m3 = options.air_density_kg_m3;
  header.sound_speed_m_s = options.sound_speed_m_s;
  header.frames = options.frames;
  header.key_frames = key_frames;
  header.vertices = vertex_total;
  header.triangles = triangle_total;
  header.bodies = body_area.size();
  comm.agree([&] {
    if (comm.is_root()) file = std::make_unique<SurfaceFile>(options.surface_file, header, tables, options.is_resumed);
  });
}

void Emission::State::set_rate(int steps_per_sample) {
  if (steps_per_sample < 1 || (!is_paper && steps_per_sample % 4 != 0))
    throw InputError(
        fmt::format("{} steps a sample cannot be filtered; take {}", steps_per_sample, find_steps(std::max(1, steps_per_sample))));
  steps = steps_per_sample;
  if (!is_paper) {
    box = find_box(steps);
    places_filter->set_rate(steps / box, 0.5 * (box - 1) / box);
    return;
  }
  box = 1;
  // w = ceil(3 / (fmax h)) = ceil(6 m); a trace of rounding is no step more.
  const double half = 6.0;
  places_filter->set_rate(steps, 0.0, half);
  pressure_filter->set_rate(steps, 0.5, half);
}

void Emission::State::gather_screens(const SurfacePart& part) {
  std::vector<std::int64_t> numbers;
  std::map<std::int32_t, bool> own;
  for (const Triangle& corner : part.silent)
    for (const std::int32_t one : corner) own[one] = true;
  for (const auto& [one, is_there] : own) {
    screen_node.push_back(one);
    numbers.push_back(part.node_number[static_cast<std::size_t>(one)]);
    for (const double x : part.nodes_m[static_cast<std::size_t>(one)]) screen_rest.push_back(x);
  }
  std::vector<std::array<std::int64_t, 3>> triangles;
  for (const Triangle& corner : part.silent) {
    triangles.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) triangles.back()[c] = part.node_number[static_cast<std::size_t>(corner[c])];
  }
  screens = comm.all_gather(triangles);
  std::map<std::int64_t, std::int64_t> place_of;
  const std::vector<std::int64_t> all = comm.all_gather(numbers);
  for (std::size_t i = 0; i < all.size(); ++i) place_of.try_emplace(all[i], static_cast<std::int64_t>(i));
  for (auto& corner : screens)
    for (std::int64_t& one : corner) one = place_of.at(one);
  balls.resize(options.ball_radius_m.size());
  screen_rows = 3 * (screen_node.size() + balls.size());
  screen_ring = static_cast<std::size_t>(kPlaceRing) / ray_frames + 2;
  screen_places.assign(screen_ring * screen_rows, 0.0);
}

/// Of the sample that begins with these displacements.
void Emission::State::keep_screens(const double* u) {
  const std::int64_t k = samples++;
  if (static_cast<std::uint64_t>(k) % ray_frames != 0) return;
  double* to = get_screens(k);
  for (std::size_t s = 0; s < screen_node.size(); ++s)
    for (std::size_t axis = 0; axis < 3; ++axis) *to++ = screen_rest[3 * s + axis] + u[4 * static_cast<std::size_t>(screen_node[s]) + axis];
  for (const Vec3& ball : balls) to = std::copy(ball.begin(), ball.end(), to);
}

void Emission::State::add_step(const double* u) {
  if (emitted >= options.frames) return;
  if (screen_rows > 0 && (step_in_sample == 0 || (is_paper && step_in_sample == steps))) keep_screens(u);
  if (is_paper) {
    loops->add_places(sum.data(), u, node.data(), node.size());
    take_mean();
    if (has_last) {
      add_pressures(mean.data());
      if (step_in_sample == steps) close_interval();
    }
    std::copy(mean.begin(), mean.end(), last_step.begin());
    has_last = true;
    places_filter->add(static_cast<int>(step_in_sample++), mean.data());
    return;
  }
  loops->add_places(sum.data(), u, node.data(), node.size());
  ++step_in_sample;
  if (++in_box < box) return;
  take_mean();
  in_box = 0;
  add_mean(mean.data());
}

/// Of the steps in the box, which is empty afterwards.
void Emission::State::take_mean() {
  const double share = 1.0 / box;
  for (std::size_t v = 0; v < node.size(); ++v) {
    for (std::size_t axis = 0; axis < 3; ++axis) mean[3 * v + axis] = share * sum[4 * v + axis];
    for (std::size_t axis = 0; axis < 4; ++axis) sum[4 * v + axis] = 0.0;
  }
}

/// The first two means say how everything moved before.
void Emission::State::add_mean(const double* value) {
  if (means == 0) {
    std::copy_n(value, get_rows(), first_mean.begin());
    means = 1;
    return;
  }
  if (means == 1) {
    means = 2;
    std::copy_n(value, get_rows(), last_mean.begin());
    begin_uniform();
    return;
  }
  std::swap(first_mean, last_mean);  // first_mean becomes the one before
  std::swap(last_mean, mean);        // whose numbers `value` are
  feed(last_mean.data());
}

/// All intervals before the first step, and the first two means.
void Emission::State::begin_uniform() {
  const int boxes = steps / box;
  const std::int64_t came = step_in_sample;
  std::vector<double> before(get_rows());
  for (std::int64_t j = -static_cast<std::int64_t>(kBefore) * boxes; j < 0; ++j) {
    for (std::size_t i = 0; i < before.size(); ++i) before[i] = first_mean[i] + static_cast<double>(j) * (last_mean[i] - first_mean[i]);
    step_in_sample = (j + static_cast<std::int64_t>(kBefore) * boxes) % boxes * box + box;
    feed(before.data());
  }
  step_in_sample = came - box;
  feed(first_mean.data());
  step_in_sample = came;
  feed(last_mean.data());
}

/// The mean of a box whose last step is step_in_sample - 1.
void Emission::State::feed(const double* value) {
  places_filter->add(static_cast<int>(step_in_sample / box) - 1, value);
  if (step_in_sample == steps) close_interval();
}

/// Eq. 5 at every step: between two steps, where the velocity is.
void Emission::State::add_pressures(const double* u) {
  const double per_step = options.sample_rate_hz * steps;
  const double impedance = options.air_density_kg_m3 * options.sound_speed_m_s;
  for (std::size_t t = 0; t < corners.size(); ++t) {
    if (place[t] < 0) continue;
    Vec3 at[3], moved{};
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3 before = get_vertex(last_step.data(), corners[t][c]), after = get_vertex(u, corners[t][c]);
      at[c] = get_vertex(rest.data(), corners[t][c]) + 0.5 * (before + after);
      moved = moved + (after - before);
    }
    const Vec3 twice = cross(at[1] - at[0], at[2] - at[0]);
    pressure[t] = impedance * (per_step / 3.0) * dot(moved, twice) / norm(twice);
  }
  pressure_filter->add(static_cast<int>(step_in_sample) - 1, pressure.data());
}

void Emission::State::close_interval() {
  const std::int64_t k = interval + 1 - LowPass::kHalf;
  double* at = get_places(k);
  places_filter->close(at);
  for (std::size_t i = 0; i < rest.size(); ++i) at[i] += rest[i];
  if (is_paper) pressure_filter->close(get_sources(k));
  step_in_sample = 0;
  ++interval;
  take_sample(k);
}

void Emission::State::take_sample(std::int64_t k) {
  if (is_paper) {
    if (k >= 0) emit(k, nullptr);
    return;
  }
  // Places before those of the first interval are not whole.
  const std::int64_t derived = k - kDerivativeHalf;
  static_assert(kPoleAhead % kBatch == 0);
  if (derived < -kPoleAhead || (derived + kPoleAhead) % kBatch != kBatch - 1) return;
  const std::int64_t first = derived - (kBatch - 1), now = first - kPoleAhead;
  calc_sources(first);
  if (now < 0) return;
  const bool is_kirchhoff = options.radiation == Radiation::kKirchhoff;
  if (is_kirchhoff) calc_poles(now);
  for (std::int64_t b = 0; b < kBatch; ++b) {
    emit(now + b, b == 0 ? pole.data() : next_poles.data() + static_cast<std::size_t>(b - 1) * corners.size());
    record(now + b);
  }
  if (is_kirchhoff) std::copy_n(next_poles.end() - static_cast<std::ptrdiff_t>(corners.size()), corners.size(), pole.begin());
}

/// d(v.S)/dt of every triangle, of a batch of samples.
void Emission::State::calc_sources(std::int64_t first) {
  for (std::size_t j = 0; j < frames.size(); ++j) frames[j] = get_places(first - kDerivativeHalf + static_cast<std::int64_t>(j));
  loops->calc_derivatives(frames.data(), get_rows(), derivative.first.data(), derivative.second.data(), velocity.data(),
                          acceleration.data());
  // The mean of three, half of the cross product, and two derivatives by samples.
  const double scale = options.sample_rate_hz * options.sample_rate_hz / 6.0;
  for (std::int64_t b = 0; b < kBatch; ++b) {
    const double* x = get_places(first + b);
    const double* v = velocity.data() + static_cast<std::size_t>(b) * get_rows();
    const double* by = acceleration.data() + static_cast<std::size_t>(b) * get_rows();
    double* to = get_sources(first + b);
    for (const Run& run : runs) {
      for (std::size_t t = run.begin; t < run.middle; ++t) {
        const Triangle& corner = corners[t];
        const Vec3 v0 = get_vertex(v, corner[0]), v1 = get_vertex(v, corner[1]), v2 = get_vertex(v, corner[2]);
        const Vec3 x0 = get_vertex(x, corner[0]), e1 = get_vertex(x, corner[1]) - x0, e2 = get_vertex(x, corner[2]) - x0;
        const Vec3 a = get_vertex(by, corner[0]) + get_vertex(by, corner[1]) + get_vertex(by, corner[2]);
        to[t] = scale * (dot(a, cross(e1, e2)) + dot(v0 + v1 + v2, cross(v1 - v0, e2) + cross(e1, v2 - v0)));
      }
      // What one side sends away the other takes in.
      for (std::size_t t = run.middle; t < run.end; ++t)
        if (twin[t] >= 0) to[t] = -to[twin[t]];
    }
  }
}

/// Of the kBatch samples behind `first`, for which there is one.
void Emission::State::calc_poles(std::int64_t first) {
  const double* frame[recording::kPoleTaps + kBatch - 1];
  double* out[kBatch];
  for (const Run& run : runs) {
    for (int j = 0; j < recording::kPoleTaps + kBatch - 1; ++j) frame[j] = get_sources(first - kPoleAhead + 1 + j) + run.begin;
    for (std::size_t b = 0; b < kBatch; ++b) out[b] = next_poles.data() + b * corners.size() + run.begin;
    loops->sum_frames(frame, run.middle - run.begin, run.pole.weight.data(), run.pole.keep, pole.data() + run.begin, out);
  }
}

/// Sample k leaves for the receivers. poles: (slots), of kKirchhoff.
void Emission::State::emit(std::int64_t k, const double* poles) {
  if (static_cast<std::uint64_t>(k) >= options.frames) return;
  emitted = static_cast<std::uint64_t>(k) + 1;
  const double fade = std::min(1.0, static_cast<double>(static_cast<std::uint64_t>(k) % ray_frames) / static_cast<double>(ray_frames));
  if (has_delta && static_cast<std::uint64_t>(k) % ray_frames == 0) look(k);
  const double* x = get_places(k);
  const double* source = get_sources(k);
  const double fs = options.sample_rate_hz, rho = options.air_density_kg_m3, per_m = fs / options.sound_speed_m_s;
  const std::size_t slots = corners.size();
  const bool is_kirchhoff = options.radiation == Radiation::kKirchhoff;
  for (const Run& run : runs) {
    for (std::size_t t = run.begin; t < (is_kirchhoff ? run.middle : run.end); ++t) {
      if (place[t] < 0) continue;
      const Vec3 x0 = get_vertex(x, corners[t][0]), x1 = get_vertex(x, corners[t][1]), x2 = get_vertex(x, corners[t][2]);
      const Vec3 centre = (1.0 / 3.0) * (x0 + x1 + x2), twice = cross(x1 - x0, x2 - x0);
      const double area_now = norm(twice), per_area = 1.0 / area_now;
      // plain: alike to all sides; turned: times the cosine.
      double plain = 0.0, turned = 0.0;
      switch (options.radiation) {
        case Radiation::kKirchhoff:
          // Of two sides what is alike to all sides cancels, and the rest is there twice.
          plain = is_whole[t] ? 0.0 : rho / (4.0 * std::numbers::pi) * source[t];
          turned = (is_whole[t] ? 2.0 : 1.0) * rho / (4.0 * std::numbers::pi) * (source[t] - run.pole.rate_per_s * poles[t]);
          break;
        case Radiation::kRayleigh:
          plain = rho / (2.0 * std::numbers::pi) * blockers[t].next(source[t], alpha);
          break;
        case Radiation::kPaper2001:
          turned = 0.5 * area_now * blockers[t].next(source[t], alpha);
          break;
      }
      for (std::size_t i = 0; i < arrivals.size(); ++i) {
        const Microphone& receiver = options.receivers[i];
        const Vec3 way = receiver.place_m - centre;
        const double r = norm(way), per_r = 1.0 / r, cosine = dot(way, twice) * per_r * per_area;
        double p = (plain + turned * cosine) * per_r;
        if (receiver.directivity != 0.0) p *= 1.0 - receiver.directivity - receiver.directivity * dot(receiver.axis, way) * per_r;
        if (has_delta) {
          const std::size_t at = i * slots + t;
          p *= static_cast<double>(seen_before[at]) + fade * (static_cast<double>(seen_now[at]) - static_cast<double>(seen_before[at]));
        }
        if (!arrivals[i].add(static_cast<double>(k) + per_m * r, p)) has_fault = true;
      }
    }
  }
}

/// Rays from every triangle to every receiver, past all surfaces as they are at sample k.
void Emission::State::look(std::int64_t k) {
  std::vector<Vec3> own(node.size());
  const double* x = get_places(k);
  for (std::size_t v = 0; v < own.size(); ++v) own[v] = get_vertex(x, static_cast<std::int32_t>(v));
  const std::vector<Vec3> all = comm.all_gather(own);
  std::vector<Vec3> vertices(vertex_total);
  for (std::size_t i = 0; i < all.size(); ++i) vertices[static_cast<std::size_t>(gathered_vertices[i])] = all[i];
  std::vector<Corners> triangles;
  for (const Triangle& corner : tables.triangles) {
    const auto at = [&](std::size_t c) { return vertices[static_cast<std::size_t>(corner[c])]; };
    triangles.push_back({at(0), at(1), at(2)});
  }
  std::vector<job::RigidObstacle> walls = options.walls;
  if (!screens.empty()) {
    std::vector<Vec3> screen;
    for (std::size_t s = 0; s < screen_node.size(); ++s) screen.push_back(get_vertex(get_screens(k), static_cast<std::int32_t>(s)));
    screen = comm.all_gather(screen);
    const auto at = [&](std::int64_t s) { return screen[static_cast<std::size_t>(s)]; };
    for (const auto& corner : screens) triangles.push_back({at(corner[0]), at(corner[1]), at(corner[2])});
  }
  for (std::size_t b = 0; b < balls.size(); ++b)
    walls.push_back(
        job::BallObstacle{get_vertex(get_screens(k), static_cast<std::int32_t>(screen_node.size() + b)), options.ball_radius_m[b]});
  const Visibility visibility(triangles);
  seen_before = seen_now;
  for (std::size_t t = 0; t < corners.size(); ++t) {
    if (place[t] < 0) continue;
    const Corners& corner = triangles[static_cast<std::size_t>(place[t])];
    const Vec3 centre = (1.0 / 3.0) * (corner[0] + corner[1] + corner[2]);
    const Vec3 out = cross(corner[1] - corner[0], corner[2] - corner[0]);
    for (std::size_t i = 0; i < arrivals.size(); ++i) {
      // A side that faces away is hidden by its own body; of a sheet, by its other side, which lies in the same plane.
      const Vec3& ear = options.receivers[i].place_m;
      const bool is_seen = dot(out, ear - centre) > 0.0 &&
                           std::none_of(walls.begin(), walls.end(), [&](const auto& wall) { return is_between(wall, centre, ear); }) &&
                           visibility.is_free(centre, ear, place[t]);
      seen_now[i * corners.size() + t] = is_seen ? 1.0F : 0.0F;
    }
  }
  if (k == 0) seen_before = seen_now;
}

void Emission::State::record(std::int64_t k) {
  if (options.surface_file.empty()) return;
  const auto frame = static_cast<std::uint64_t>(k);
  if (frame < options.frames) {
    const double* source = get_sources(k);
    const std::size_t at = frame % recording::kBlockFrames;
    std::size_t own = 0;
    for (std::size_t t = 0; t < corners.size(); ++t)
      if (place[t] >= 0) block[own++ * recording::kBlockFrames + at] = static_cast<float>(source[t] / area[t]);
    if (at + 1 == recording::kBlockFrames || frame + 1 == options.frames) write_block(frame / recording::kBlockFrames);
  }
  if (frame % key_frames == 0 && frame / key_frames < header.count_keys()) write_key(frame / key_frames, k);
}

void Emission::State::write_block(std::uint64_t number) {
  const std::size_t own = block.size() / recording::kBlockFrames;
  std::vector<float> scale(own, 0.0F);
  std::vector<std::int16_t> value(block.size());
  for (std::size_t t = 0; t < own; ++t) {
    const auto row = std::span(block).subspan(t * recording::kBlockFrames, recording::kBlockFrames);
    float most = 0.0F;
    for (float& one : row) {
      if (!(std::abs(one) <= 1e12F)) {
        has_fault = true;
        one = 0.0F;
      }
      most = std::max(most, std::abs(one));
    }
    scale[t] = most / 32767.0F;
    for (std::size_t i = 0; i < row.size(); ++i)
      value[t * recording::kBlockFrames + i] =
          scale[t] > 0.0F ? static_cast<std::int16_t>(std::clamp(std::lrint(row[i] / scale[t]), -32767L, 32767L)) : std::int16_t{0};
  }
  std::fill(block.begin(), block.end(), 0.0F);
  const auto scales = comm.all_gather(scale);
  const auto values = comm.all_gather(value);
  comm.agree([&] {
    if (!comm.is_root()) return;
    std::vector<float> all_scales(triangle_total);
    std::vector<std::int16_t> all_values(triangle_total * recording::kBlockFrames);
    for (std::size_t i = 0; i < scales.size(); ++i) {
      const auto at = static_cast<std::size_t>(gathered_places[i]);
      all_scales[at] = scales[i];
      std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(i * recording::kBlockFrames), recording::kBlockFrames,
                  all_values.begin() + static_cast<std::ptrdiff_t>(at * recording::kBlockFrames));
    }
    file->write_block(number, all_scales, all_values);
  });
}

void Emission::State::write_key(std::uint64_t key, std::int64_t k) {
  std::vector<Vec3> own(node.size());
  const double* x = get_places(k);
  for (std::size_t v = 0; v < own.size(); ++v) {
    own[v] = get_vertex(x, static_cast<std::int32_t>(v));
    for (double& one : own[v])
      if (!(std::abs(one) <= 1e6)) {
        has_fault = true;
        one = 0.0;
      }
  }
  const std::vector<Vec3> all = comm.all_gather(own);
  comm.agree([&] {
    if (!comm.is_root()) return;
    std::vector<Vec3> vertices(vertex_total);
    for (std::size_t i = 0; i < all.size(); ++i) vertices[static_cast<std::size_t>(gathered_vertices[i])] = all[i];
    file->write_key(key, vertices);
  });
  keys_written = static_cast<std::int32_t>(key) + 1;
}

void Emission::State::finish() {
  comm.agree([&] {
    if (is_finished) throw SolveError("the sound was finished before");
    const std::int64_t there = interval + (step_in_sample > 0 ? 1 : 0);
    if (means < 2 && !is_paper) throw SolveError("the sound has no two steps");
    if (emitted < options.frames && there < static_cast<std::int64_t>(options.frames))
      throw SolveError(
          fmt::format("{} samples of {} were simulated; finish the run first", std::max<std::int64_t>(0, there), options.frames));
  });
  is_finished = true;
  const auto keys = !options.surface_file.empty() ? static_cast<std::int32_t>(header.count_keys()) : 0;
  const auto is_done = [&] { return emitted >= options.frames && keys_written >= keys; };
  if (is_paper) {
    std::vector<double> still(4 * (node.empty() ? 1 : 1 + static_cast<std::size_t>(*std::max_element(node.begin(), node.end()))), 0.0);
    for (std::size_t v = 0; v < node.size(); ++v)
      for (std::size_t axis = 0; axis < 3; ++axis) still[4 * static_cast<std::size_t>(node[v]) + axis] = last_step[3 * v + axis];
    while (!is_done()) add_step(still.data());
  } else {
    in_box = 0;
    step_in_sample = step_in_sample / box * box;
    std::vector<double> after = last_mean, by(after.size());
    for (std::size_t i = 0; i < by.size(); ++i) by[i] = last_mean[i] - first_mean[i];
    while (!is_done()) {
      for (std::size_t i = 0; i < by.size(); ++i) after[i] += by[i];
      step_in_sample += box;
      feed(after.data());
    }
  }
  comm.agree([&] {
    if (has_fault)
      throw SolveError("a surface makes more than 1e4 Pa, or moves by what is no number: the motion is not stable; take a shorter step");
    if (file) file->commit();
  });
}

template <typename Visit>
void Emission::State::visit_state(Visit&& visit) {
  visit.one(steps);
  visit.one(step_in_sample);
  visit.one(in_box);
  visit.one(interval);
  visit.one(has_fault);
  visit.one(has_last);
  visit.one(keys_written);
  visit.one(emitted);
  visit.one(means);
  visit.one(samples);
  for (auto* list : {&sum, &first_mean, &last_mean, &last_step, &places, &sources, &pole, &screen_places}) visit.list(*list);
  visit.list(blockers);
  visit.list(seen_before);
  visit.list(seen_now);
  visit.list(block);
}

Emission::Emission(const comm::Communicator& comm, SurfacePart part, Options options)
    : state_(std::make_unique<State>(comm, std::move(part), std::move(options))) {}
Emission::~Emission() = default;

void Emission::add_step(const double* displacement_m) { state_->add_step(displacement_m); }
void Emission::set_balls(std::span<const Vec3> centres_m) {
  if (state_->has_delta) state_->balls.assign(centres_m.begin(), centres_m.end());
}
bool Emission::has_fault() const { return state_->has_fault; }
bool Emission::is_at_sample() const { return state_->step_in_sample == (state_->is_paper && state_->has_last ? 1 : 0); }
void Emission::finish() { state_->finish(); }

void Emission::set_steps_per_sample(int steps) {
  if (steps == state_->steps) return;
  if (state_->is_paper) throw InputError("with radiation paper2001 the step cannot change during a run");
  if (!is_at_sample() || state_->means < 2) throw InputError("the step can only change at the beginning of a sample");
  // What the last two means say is per box.
  const double before = static_cast<double>(state_->box) / state_->steps;
  state_->set_rate(steps);
  const double ratio = static_cast<double>(state_->box) / state_->steps / before;
  for (std::size_t i = 0; i < state_->first_mean.size(); ++i)
    state_->first_mean[i] = state_->last_mean[i] - ratio * (state_->last_mean[i] - state_->first_mean[i]);
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
  Saver saver{bytes};
  state_->visit_state(saver);
  state_->places_filter->save(bytes);
  if (state_->pressure_filter) state_->pressure_filter->save(bytes);
  for (const Arrivals& one : state_->arrivals) one.save(bytes);
  return bytes;
}

void Emission::load(std::span<const std::byte> bytes) {
  Loader loader{bytes};
  state_->visit_state(loader);
  state_->places_filter->load(bytes);
  if (state_->pressure_filter) state_->pressure_filter->load(bytes);
  for (Arrivals& one : state_->arrivals) one.load(bytes);
  if (!bytes.empty()) throw InputError("the state of the sound is too long; remove the checkpoint and run again");
  state_->set_rate(state_->steps);
}

}  // namespace carillon::emission
