// Functions called from JavaScript: numbers in and out; strings and arrays by address in the module's memory.
// Method: one Engine or one Workshop per module. Exceptions return -1 with the message as text.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/bindings/web/engine.hpp"
#include "runtime/bindings/web/results.hpp"
#include "runtime/bindings/web/workshop.hpp"

namespace {

using namespace carillon;

constexpr int kChannels = 16, kFrames = 1024;

std::unique_ptr<web::Engine> engine;
std::unique_ptr<web::Workshop> workshop;
float channels[kChannels][kFrames];
float* const channel_at[kChannels] = {channels[0],  channels[1],  channels[2],  channels[3], channels[4],  channels[5],
                                      channels[6],  channels[7],  channels[8],  channels[9], channels[10], channels[11],
                                      channels[12], channels[13], channels[14], channels[15]};

web::Engine& get_engine() {
  if (engine == nullptr) throw InputError("the engine is not open");
  return *engine;
}
web::Workshop& get_workshop() {
  if (workshop == nullptr) throw InputError("the workshop is not open");
  return *workshop;
}

synth::EffectSet to_effects(int mask) { return synth::EffectSet::from_mask(static_cast<unsigned>(mask)); }
std::optional<double> to_time(double time_s, int is_exact) { return is_exact != 0 ? std::optional(time_s) : std::nullopt; }

}  // namespace

// ---- common

/// "simd128" or "plain".
WEB_EXPORT(int, web_instructions)() {
  text = base::get_name(base::find_instructions());
  return 0;
}

// ---- engine, on the audio thread

/// microphones_m: `count` numbers, three per position.
WEB_EXPORT(int, web_open)(double rate_hz, const double* microphones_m, int count, int max_bodies, double roughness_m, double friction) {
  return run([&] {
    if (count < 3 || count > 3 * kChannels || count % 3 != 0) throw InputError("give 1 to 16 microphones, three numbers each");
    synth::SynthesiserOptions options{.rate_hz = rate_hz,
                                      .max_bodies = max_bodies,
                                      .max_strikes = 256,
                                      .max_forces = 2048,
                                      .max_waypoints = 1024,
                                      .ring_events = 1 << 14};
    options.microphones_m.clear();
    for (int m = 0; m < count; m += 3) options.microphones_m.push_back({microphones_m[m], microphones_m[m + 1], microphones_m[m + 2]});
    options.ground.roughness_m = roughness_m;
    options.ground.friction = friction;
    engine = std::make_unique<web::Engine>(options);
    return 0;
  });
}
WEB_EXPORT(int, web_begin_surface)(int surface, int triangles, int columns, int largest, int shape) {
  const auto size = [](int x) { return static_cast<std::size_t>(std::max(x, 0)); };
  return run([&] { return get_engine().begin_surface(surface, {size(triangles), size(columns), size(largest), size(shape)}), 0; });
}
WEB_EXPORT(int, web_add_to_surface)(int surface, const std::byte* at, int size) {
  return run([&] { return get_engine().add_to_surface(surface, to_span(at, size)), 0; });
}
WEB_EXPORT(int, web_add_model)(int model, int surface, const std::byte* at, int size) {
  return run([&] { return get_engine().add_model(model, surface, to_span(at, size)), 0; });
}
WEB_EXPORT(int, web_release_model)(int model) {
  return run([&] { return get_engine().release_model(model), 0; });
}
WEB_EXPORT(int, web_release_surface)(int surface) {
  return run([&] { return get_engine().release_surface(surface), 0; });
}
/// pose: centre of mass (3), rotation (4), silence_pa, roughness_m, friction, upper and lower 32 bits of the seed.
WEB_EXPORT(int, web_add_body)(int model, const double* pose, int count, int effects) {
  return run([&] {
    if (count != 12) throw InputError("a body is described by twelve numbers");
    for (int k = 10; k < 12; ++k)
      if (!(pose[k] >= 0.0 && pose[k] < 4294967296.0)) throw InputError("a seed is two numbers of 32 bits");
    const auto seed = static_cast<std::uint64_t>(pose[10]) << 32 | static_cast<std::uint64_t>(pose[11]);
    return get_engine().add_body(model, {.position_m = {pose[0], pose[1], pose[2]},
                                         .rotation = {pose[3], pose[4], pose[5], pose[6]},
                                         .effects = to_effects(effects),
                                         .silence_pa = pose[7],
                                         .surface = {.roughness_m = pose[8], .friction = pose[9], .seed = seed}});
  });
}
WEB_EXPORT(int, web_swap_model)(int body, int model) {
  return run([&] { return get_engine().swap_model(body, model), 0; });
}
WEB_EXPORT(int, web_set_solo)(int body, int mode) {
  return run([&] { return get_engine().set_solo(body, mode), 0; });
}
WEB_EXPORT(int, web_remove_body)(int body) {
  return run([&] { return get_engine().remove_body(body), 0; });
}
/// Number of rejected events; the text has the last reason.
WEB_EXPORT(int, web_push)(const double* at, int count) {
  return run([&] {
    const int refused = get_engine().push(to_span(at, count));
    if (refused > 0) text = get_engine().find_fault();
    return refused;
  });
}
/// bodies: engine numbers, by number in the recording.
WEB_EXPORT(int, web_begin_playback)(int playback, const int* bodies, int count, double at_s, double from_s) {
  return run([&] {
    const auto all = to_span(bodies, count);
    return get_engine().begin_playback(playback, {.bodies = {all.begin(), all.end()}, .at_s = at_s, .from_s = from_s}), 0;
  });
}
WEB_EXPORT(int, web_add_to_playback)(int playback, const double* at, int count) {
  return run([&] { return get_engine().add_to_playback(playback, to_span(at, count)), 0; });
}
WEB_EXPORT(int, web_end_playback)(int playback) {
  return run([&] { return get_engine().end_playback(playback), 0; });
}
WEB_EXPORT(const float*, web_channel)(int channel) { return channels[std::clamp(channel, 0, kChannels - 1)]; }
/// Renders the next frames (at most 1024) into the first `count` channels.
WEB_EXPORT(int, web_process)(int count, int frames) {
  return run([&] { return get_engine().process(channel_at, std::clamp(count, 0, kChannels), std::clamp(frames, 0, kFrames)), 0; });
}
WEB_EXPORT(double, web_time_s)() { return engine == nullptr ? 0.0 : engine->get_synthesiser().get_time_s(); }
WEB_EXPORT(double, web_horizon_s)() { return engine == nullptr ? 0.0 : engine->get_synthesiser().get_horizon_s(); }
WEB_EXPORT(int, web_set_gain)(double per_pa) {
  return run([&] { return get_engine().get_synthesiser().set_gain(per_pa), 0; });
}
WEB_EXPORT(int, web_set_budget)(double mode_samples_per_s) {
  return run([&] { return get_engine().get_synthesiser().set_budget(mode_samples_per_s), 0; });
}
WEB_EXPORT(int, web_keep_load)(double share, double busy_s) {
  return run([&] { return get_engine().keep_load(std::clamp(share, 0.01, 1.0), busy_s), 0; });
}
/// Writes the amplitudes of a body's modes, by number in the bank, to the numbers.
WEB_EXPORT(int, web_measure)(int body, int modes) {
  return run([&] {
    numbers.resize(std::clamp(modes, 0, 1 << 20));
    return get_engine().get_synthesiser().measure_amplitudes(body, numbers) ? 0 : 1;
  });
}
/// Largest pressure of a body so far [Pa at 1 m].
WEB_EXPORT(double, web_peak_pa)(int body) { return engine == nullptr ? 0.0 : engine->get_synthesiser().get_peak_pa(body); }
/// See synth::Synthesiser::get_deflection().
WEB_EXPORT(double, web_deflection)(int body) { return engine == nullptr ? 0.0 : engine->get_synthesiser().get_deflection(body); }
/// Writes strikes, refused, late, faults, overflows, resets, mode_samples, faded, underruns, zeroed and the budget to the words.
WEB_EXPORT(int, web_count)() {
  return run([&] {
    const synth::SynthesiserCounters c = get_engine().get_synthesiser().get_counters();
    words.clear();
    for (const std::int64_t x :
         {c.strikes, c.refused, c.late, c.faults, c.overflows, c.resets, c.mode_samples, c.faded, c.underruns, c.zeroed})
      words.push_back(static_cast<double>(x));
    words.push_back(get_engine().get_synthesiser().get_budget());
    return 0;
  });
}

// ---- workshop, on a worker

WEB_EXPORT(int, web_open_workshop)(double rate_hz) {
  return run([&] {
    workshop = std::make_unique<web::Workshop>(rate_hz);
    text = workshop->list_choices();
    return 0;
  });
}
WEB_EXPORT(int, web_add_bank)(int bank, const std::byte* at, int size, const char* name, int name_size) {
  return run([&] {
    text = get_workshop().add_bank(bank, to_span(at, size), std::string(to_text(name, name_size)));
    return 0;
  });
}
WEB_EXPORT(int, web_remove_bank)(int bank) {
  return run([&] { return get_workshop().remove_bank(bank), 0; });
}
/// Writes the vertices of a bank (V, 3) [m] to the numbers.
WEB_EXPORT(int, web_list_vertices)(int bank) {
  return run([&] {
    numbers.clear();
    for (const Vec3& vertex : get_workshop().get_bank(bank).vertices_m)
      for (const double x : vertex) numbers.push_back(static_cast<float>(x));
    return 0;
  });
}
/// Writes the (T, 3) indices to the bytes, in memory order.
WEB_EXPORT(int, web_list_triangles)(int bank) {
  return run([&] {
    const auto& triangles = get_workshop().get_bank(bank).triangles;
    bytes.resize(triangles.size() * sizeof(triangles[0]));
    if (!triangles.empty()) std::memcpy(bytes.data(), triangles.data(), bytes.size());
    return 0;
  });
}
WEB_EXPORT(int, web_calc_shape)(int bank, int mode) {
  return run([&] {
    numbers = get_workshop().calc_shape(bank, mode);
    return 0;
  });
}
WEB_EXPORT(int, web_calc_density)(int bank, int mode) {
  return run([&] {
    numbers = get_workshop().calc_density(bank, mode);
    return 0;
  });
}
WEB_EXPORT(int, web_make_body)(int body, int bank, const char* scene, int scene_size, const char* edits, int edits_size) {
  return run([&] {
    text = get_workshop().make_body(body, bank, to_text(scene, scene_size), to_text(edits, edits_size));
    return 0;
  });
}
WEB_EXPORT(int, web_remove_made_body)(int body) {
  return run([&] { return get_workshop().remove_body(body), 0; });
}
/// Writes the tables of a body's model to the bytes.
WEB_EXPORT(int, web_write_tables)(int body) {
  return run([&] {
    bytes = get_workshop().get_body(body).model->write_tables();
    return 0;
  });
}
/// Part 0 triangles, 1 largest motions, 2 shapes: size and address of a part of a model's surface. Equal addresses: two bodies share it.
WEB_EXPORT(int, web_surface_bytes)(int body, int part) {
  return run([&] {
    const synth::ModelSurface& surface = *get_workshop().get_body(body).model->get_surface();
    return part == 0   ? surface.triangles.size() * sizeof(surface.triangles[0])
           : part == 1 ? surface.largest.size() * sizeof(float)
                       : surface.shape.size() * sizeof(std::int16_t);
  });
}
WEB_EXPORT(const void*, web_surface_part)(int body, int part) {
  const void* at = nullptr;
  run([&] {
    const synth::ModelSurface& surface = *get_workshop().get_body(body).model->get_surface();
    at = part == 0   ? static_cast<const void*>(surface.triangles.data())
         : part == 1 ? static_cast<const void*>(surface.largest.data())
                     : static_cast<const void*>(surface.shape.data());
    return 0;
  });
  return at;
}
WEB_EXPORT(int, web_surface_columns)(int body) {
  return run([&] { return get_workshop().get_body(body).model->get_surface()->columns; });
}
WEB_EXPORT(const void*, web_surface_address)(int body) {
  const void* at = nullptr;
  run([&] {
    at = get_workshop().get_body(body).model->get_surface().get();
    return 0;
  });
  return at;
}
/// Writes its events to the words, its result to the text.
WEB_EXPORT(int, web_make_blow)
(int body, const char* scene, int scene_size, int triangle, double a, double b, double c, double time_s, int is_exact, int number) {
  return run([&] {
    words.clear();
    text = get_workshop().make_blow(body, to_text(scene, scene_size), triangle, {a, b, c}, to_time(time_s, is_exact), number, words);
    return 0;
  });
}
WEB_EXPORT(int, web_make_ping)(int body, int mode, double pressure_pa, int number) {
  return run([&] {
    words.clear();
    get_workshop().make_ping(body, mode, pressure_pa, number, words);
    return 0;
  });
}
WEB_EXPORT(int, web_calc_levels)(int body, int triangle, double a, double b, double c) {
  return run([&] {
    numbers = get_workshop().calc_levels(body, triangle, {a, b, c});
    return 0;
  });
}
WEB_EXPORT(int, web_make_plan)(const char* scene, int scene_size, const int* bodies, int count, const double* at, int words_count) {
  return run([&] {
    text = get_workshop().make_plan(to_text(scene, scene_size), to_span(bodies, count), to_span(at, words_count));
    return 0;
  });
}
/// Plan of a recording for the bodies it was read with.
WEB_EXPORT(int, web_plan_recording)(const char* scene, int scene_size, int recording) {
  return run([&] {
    text = get_workshop().plan_recording(to_text(scene, scene_size), recording);
    return 0;
  });
}
WEB_EXPORT(int, web_add_recording)(int recording, const char* at, int size, const char* name, int name_size, const int* bodies, int count) {
  return run([&] {
    text = get_workshop().add_recording(recording, to_text(at, size), std::string(to_text(name, name_size)), to_span(bodies, count));
    return 0;
  });
}
WEB_EXPORT(int, web_remove_recording)(int recording) {
  return run([&] { return get_workshop().remove_recording(recording), 0; });
}
/// Writes all its events to the words.
WEB_EXPORT(int, web_list_recording)(int recording) {
  return run([&] {
    const auto all = get_workshop().get_recording(recording);
    words.assign(all.begin(), all.end());
    return 0;
  });
}
/// Writes the poses of a body to the words, 8 each.
WEB_EXPORT(int, web_list_poses)(int recording, int body) {
  return run([&] {
    words = get_workshop().list_poses(recording, body);
    return 0;
  });
}
