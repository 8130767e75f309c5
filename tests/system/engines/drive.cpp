// engine_NAME HZ SECONDS OUT.jsonl [LIVE.f32 [MAX_IMPACTS [WAY]]] < BODIES: the sound of a physics engine's scene. OUT: its contacts file;
// LIVE: pressure at two ears [Pa], pairs of floats at 48 kHz; "-": none. WAY: "found", impulses are withheld, and found from the
// velocities; "early", hits are reported when they begin. A line of BODIES: name kind bank, then half extents, position, rotation
// (w x y z), velocity and spin. Prints as JSON: counters, CPU time of all and of the tracker, the engine's vertical impulses from the
// ground.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <map>
#include <stdexcept>

#include "runtime/bank/bank.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/events/file.hpp"
#include "tests/system/engines/engine.hpp"

namespace {

using namespace carillon;
using testing::Solid;

char message[512];
bool is_found = false;    // impulses are withheld
double pushed_n_s = 0.0;  // the engine's impulses from the ground on bodies, upwards; without unknown ones
double tracker_s = 0.0;   // CPU time of carillon_touches_step

void check(carillon_status status) {
  if (status != CARILLON_OK) throw std::runtime_error(std::string(carillon_status_text(status)) + ": " + message);
}

double get_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// The events of the tracker as lines of a contacts file, and to a synthesiser.
class Recorder {
 public:
  explicit Recorder(carillon_synth* synth) : synth_(synth) {}

  static void take(void* self, int32_t kind, const void* event) { static_cast<Recorder*>(self)->take(kind, event); }
  void write(const char* file, const std::vector<events::RecordedBody>& bodies) const {
    std::ofstream out(file, std::ios::binary);
    out << events::format_header(bodies, count_) << lines_;
    if (!out.flush()) throw std::runtime_error(std::string(file) + ": cannot be written");
  }

 private:
  void take(int32_t kind, const void* event) {
    if (kind == CARILLON_EVENT_MARK) {
      const double time_s = *static_cast<const double*>(event);
      append(events::TimeWatermark{time_s}, carillon_push_mark(synth_, time_s));
    } else if (kind == CARILLON_EVENT_IMPULSE) {
      const auto& from = *static_cast<const carillon_impulse*>(event);
      events::Impulse to;
      set_place(from, to);
      std::copy_n(from.impulse_n_s, 3, to.impulse_n_s.begin());
      to.duration_s = from.duration_s;
      append(to, carillon_push_impulse(synth_, &from));
    } else if (kind == CARILLON_EVENT_FORCE) {
      const auto& from = *static_cast<const carillon_force*>(event);
      events::Force to;
      set_place(from, to);
      to.step_s = from.step_s;
      to.count = from.count;
      to.continues = from.continues != 0;
      for (int k = 0; k < from.count; ++k) std::copy_n(from.impulse_n_s[k], 3, to.impulse_n_s[k].begin());
      append(to, carillon_push_force(synth_, &from));
    } else if (kind == CARILLON_EVENT_CONTACT) {
      const auto& from = *static_cast<const carillon_contact*>(event);
      events::LastingContact to;
      set_place(from, to);
      to.state = static_cast<decltype(to.state)>(from.state);
      to.id = from.id;
      std::copy_n(from.normal, 3, to.normal.begin());
      std::copy_n(from.slip_m_s, 3, to.slip_m_s.begin());
      to.force_n = from.force_n;
      to.sweep_m_s = from.sweep_m_s;
      to.other_sweep_m_s = from.other_sweep_m_s;
      to.spin_rad_s = from.spin_rad_s;
      to.patch_radius_m = from.patch_radius_m;
      to.impedance_n_s_m = from.impedance_n_s_m;
      append(to, carillon_push_contact(synth_, &from));
    } else {
      const auto& from = *static_cast<const carillon_motion*>(event);
      events::BodyMotion to;
      to.time_s = from.time_s;
      to.body = from.body;
      std::copy_n(from.position_m, 3, to.position_m.begin());
      std::copy_n(from.velocity_m_s, 3, to.velocity_m_s.begin());
      std::copy_n(from.rotation, 4, to.rotation.begin());
      to.cut = from.cut != 0;
      append(to, carillon_push_motion(synth_, &from));
    }
  }
  template <class From, class To>
  static void set_place(const From& from, To& to) {
    to.time_s = from.time_s;
    to.body = from.body;
    to.other = from.other;
    to.triangle = from.triangle;
    std::copy_n(from.barycentric, 3, to.barycentric.begin());
  }
  void append(const events::Event& event, carillon_status status) {
    if (synth_ != nullptr && status != CARILLON_OK) throw std::runtime_error("an event cannot be played");
    events::append_line(lines_, event);
    ++count_;
  }

  carillon_synth* synth_;
  std::string lines_;
  std::uint64_t count_ = 0;
};

std::vector<Solid> read_solids(std::istream& in) {
  std::vector<Solid> solids;
  for (Solid s; in >> s.name >> s.kind >> s.bank; solids.push_back(s)) {
    for (double* list : {s.half_m, s.position_m}) in >> list[0] >> list[1] >> list[2];
    for (double& x : s.rotation) in >> x;
    for (double* list : {s.velocity_m_s, s.spin_rad_s}) in >> list[0] >> list[1] >> list[2];
    in >> s.restitution;
    if (!in) throw std::runtime_error("a body is incomplete");
  }
  return solids;
}

/// Banks of both interfaces, kept until the program ends.
struct OpenBank {
  explicit OpenBank(const std::string& file) : ours(bank::read_bank(file)) {
    check(carillon_bank_open(file.c_str(), &bank, message, sizeof message));
    carillon_model_options options;
    carillon_model_options_init(&options);
    check(carillon_model_make(bank, &options, &model, message, sizeof message));
  }
  bank::Bank ours;
  carillon_bank* bank = nullptr;
  carillon_model* model = nullptr;
};

carillon_synth* make_synth() {
  carillon_synth* synth = nullptr;
  carillon_options options;
  carillon_options_init(&options);
  options.listener_m[1] = -1.0;
  options.listener_m[2] = 0.4;
  options.ring_events = 1 << 16;
  options.max_strikes = 256;
  check(carillon_create(&options, &synth, message, sizeof message));
  return synth;
}

int32_t add_body(carillon_synth* synth, const OpenBank& bank, const Solid& solid) {
  carillon_body_options options;
  carillon_body_options_init(&options);
  options.effects |= CARILLON_CONTACT_DAMPING;  // profiles of roughness have other seeds in a scene file
  std::copy_n(solid.position_m, 3, options.position_m);
  std::copy_n(solid.rotation, 4, options.rotation);
  options.friction = 0.4;
  int32_t number = 0;
  check(carillon_add_body_with(synth, bank.model, &options, &number, message, sizeof message));
  return number;
}

void play(carillon_synth* synth, double until_s, std::vector<float>& heard) {
  while (carillon_time_s(synth) + 256 / 48000.0 <= until_s) {
    float left[128], right[128];
    float* const ears[] = {left, right};
    carillon_process(synth, ears, 2, 128);
    for (int n = 0; n < 128; ++n) heard.insert(heard.end(), {left[n], right[n]});
  }
}

void print_figures(carillon_touches* touches, const carillon_counters& counters, double latest_s, double total_s, double mass_kg) {
  carillon_touches_counters seen;
  carillon_touches_counters_init(&seen);
  check(carillon_touches_get_counters(touches, &seen));
  std::printf(
      "{\"steps\": %lld, \"points\": %lld, \"bad_points\": %lld, \"hits\": %lld, \"touches\": %lld, \"latest_s\": %.6g, "
      "\"cpu_s\": %.6g, \"tracker_cpu_s\": %.6g, \"lost\": %lld, \"limited\": %lld, \"pushed_n_s\": %.9g, \"mass_kg\": %.9g}\n",
      static_cast<long long>(seen.steps), static_cast<long long>(seen.points), static_cast<long long>(seen.bad_points),
      static_cast<long long>(seen.hits), static_cast<long long>(seen.touches), latest_s, total_s, tracker_s,
      static_cast<long long>(counters.refused + counters.late + counters.faults + counters.overflows + counters.resets),
      static_cast<long long>(seen.limited), pushed_n_s, mass_kg);
}

void run(double hz, double seconds, const char* contacts, const char* live, const char* max_impacts, const std::string& way) {
  std::vector<Solid> solids = read_solids(std::cin);
  std::map<std::string, OpenBank> banks;
  std::vector<events::RecordedBody> recorded;
  carillon_synth* synth = live != nullptr ? make_synth() : nullptr;
  Recorder recorder(synth);
  carillon_touches* touches = nullptr;
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  testing::set_options(options);
  if (max_impacts != nullptr) options.max_impacts = std::atoi(max_impacts);
  is_found = way == "found";
  options.early = way == "early" ? 1 : 0;
  options.sink = Recorder::take;
  options.user = &recorder;
  check(carillon_touches_create(synth, &options, &touches, message, sizeof message));
  for (Solid& solid : solids) {
    const OpenBank& bank = banks.try_emplace(solid.bank, solid.bank).first->second;
    solid.mass_kg = bank.ours.rigid.mass_kg;
    const auto& material = bank.ours.material;
    solid.modulus_pa = material.young_modulus_pa / (1.0 - material.poisson_ratio * material.poisson_ratio);
    for (int k = 0; k < 3; ++k) solid.inertia_kg_m2[k] = bank.ours.rigid.inertia_kg_m2[4 * k];
    carillon_touches_body body;
    carillon_touches_body_init(&body);
    body.body = synth != nullptr ? add_body(synth, bank, solid) : static_cast<int32_t>(recorded.size());
    body.bank = bank.bank;
    body.name_seed = carillon_name_seed(solid.name.c_str());
    int32_t index = 0;
    check(carillon_touches_add(touches, &body, &index, message, sizeof message));
    recorded.push_back({solid.name, std::ssize(bank.ours.triangles), events::mark_surface(bank.ours.vertices_m, bank.ours.triangles)});
  }
  std::vector<float> heard;
  double total_s = -get_cpu_s(), latest_s = 0.0;
  const auto engine = testing::make_engine(solids, 1.0 / hz, touches);
  check(engine->start(message, sizeof message));
  const int steps = static_cast<int>(seconds * hz + 0.5);
  for (int n = 1; n <= steps; ++n) {
    check(engine->step(n / hz, message, sizeof message));
    latest_s = std::max(latest_s, n / hz - carillon_touches_mark_s(touches));
    if (synth != nullptr) play(synth, carillon_touches_mark_s(touches), heard);
  }
  total_s += get_cpu_s();
  recorder.write(contacts, recorded);
  carillon_counters counters;
  carillon_counters_init(&counters);
  if (synth != nullptr) {
    check(carillon_get_counters(synth, &counters));
    std::ofstream(live, std::ios::binary)
        .write(reinterpret_cast<const char*>(heard.data()), static_cast<std::streamsize>(heard.size() * sizeof(float)));
  }
  print_figures(touches, counters, latest_s, total_s, solids.front().mass_kg);
  carillon_touches_destroy(touches);
  carillon_destroy(synth);
}

}  // namespace

// Between the adapter and the library (--wrap of the linker).
extern "C" {
carillon_status __real_carillon_touches_step(carillon_touches*, double, const carillon_pose*, int32_t, const carillon_point*, int32_t,
                                             char*, size_t);
carillon_status __wrap_carillon_touches_step(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                             const carillon_point* points, int32_t count, char* text, size_t size) {
  std::vector<carillon_point> given(points, points + count);
  for (carillon_point& p : given) {
    if (p.b < 0 && std::isfinite(p.impulse_n_s)) pushed_n_s += p.impulse_n_s * p.normal[2];
    if (is_found) p.impulse_n_s = p.friction_n_s[0] = p.friction_n_s[1] = p.friction_n_s[2] = std::nan("");
  }
  tracker_s -= carillon::base::get_thread_cpu_s();
  const carillon_status status = __real_carillon_touches_step(touches, time_s, poses, bodies, given.data(), count, text, size);
  tracker_s += carillon::base::get_thread_cpu_s();
  return status;
}
}

int main(int argc, char** argv) {
  if (argc < 4) return std::fputs("usage: engine_NAME HZ SECONDS OUT.jsonl [LIVE.f32 [MAX_IMPACTS [WAY]]] < BODIES\n", stderr), 2;
  try {
    run(std::atof(argv[1]), std::atof(argv[2]), argv[3], argc > 4 && std::string(argv[4]) != "-" ? argv[4] : nullptr,
        argc > 5 ? argv[5] : nullptr, argc > 6 ? argv[6] : "");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 1;
  }
  return 0;
}
