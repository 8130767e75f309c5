// Functions of the physics module called from JavaScript: numbers in and out; strings and arrays by address in the module's memory.
// Method: one PageWorld per module. Exceptions return -1 with the message as text.
#include <memory>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/bindings/web/results.hpp"
#include "runtime/bindings/web/world.hpp"

namespace {

using namespace carillon;

std::unique_ptr<web::PageWorld> world;

web::PageWorld& get_world() {
  if (world == nullptr) throw InputError("the world is not open");
  return *world;
}

/// Three numbers at a place of a row.
Vec3 take_vector(std::span<const double> row, std::size_t first) {
  if (row.size() < first + 3) throw InputError("a point is three numbers");
  return {row[first], row[first + 1], row[first + 2]};
}

}  // namespace

WEB_EXPORT(int, web_open_world)() {
  return run([] { return world = std::make_unique<web::PageWorld>(), 0; });
}
WEB_EXPORT(int, web_add_bank)(int bank, const std::byte* at, int size, const char* name, int name_size) {
  return run([&] { return get_world().add_bank(bank, to_span(at, size), std::string(to_text(name, name_size))), 0; });
}
WEB_EXPORT(int, web_add_world_body)(int bank, const double* row, int count, const char* name, int name_size) {
  return run([&] { return get_world().add_body(bank, to_span(row, count), std::string(to_text(name, name_size))); });
}
WEB_EXPORT(int, web_start_world)(const double* row, int count) {
  return run([&] { return get_world().start(to_span(row, count)), 0; });
}
/// Writes the events until a time to the words, and last the time reached.
WEB_EXPORT(int, web_advance_world)(double until_s) {
  return run([&] {
    words.clear();
    const double reached_s = get_world().advance(until_s, words);
    words.push_back(reached_s);
    return 0;
  });
}
/// point: three numbers, or none: the centre of mass.
WEB_EXPORT(int, web_push_body)(int body, const double* impulse, int count, const double* point, int point_count) {
  return run([&] {
    physics::World& w = get_world().get_world();
    w.push(body, point_count > 0 ? take_vector(to_span(point, point_count), 0) : w.get_centre(body),
           take_vector(to_span(impulse, count), 0));
    return 0;
  });
}
WEB_EXPORT(int, web_grab_body)
(int body, const double* point, int count, double frequency_hz, double damping_ratio, double max_force_n) {
  return run([&] {
    physics::World& w = get_world().get_world();
    w.grab(body, count > 0 ? take_vector(to_span(point, count), 0) : w.get_centre(body),
           {.frequency_hz = frequency_hz, .damping_ratio = damping_ratio, .max_force_n = max_force_n});
    return 0;
  });
}
WEB_EXPORT(int, web_drag_body)(int body, const double* target, int count, double over_s) {
  return run([&] { return get_world().get_world().drag(body, take_vector(to_span(target, count), 0), over_s), 0; });
}
WEB_EXPORT(int, web_release_grab)(int body) {
  return run([&] { return get_world().get_world().release(body), 0; });
}
/// may_begin: 0 or 1.
WEB_EXPORT(int, web_allow_modal_impacts)(int may_begin) {
  return run([&] { return get_world().get_world().allow_modal_impacts(may_begin != 0), 0; });
}
/// Position of the mesh frame (3), rotation (4), velocity (3), angular velocity (3).
WEB_EXPORT(int, web_enter_body)(int body, const double* row, int count) {
  return run([&] {
    const std::span<const double> numbers_in = to_span(row, count);
    if (numbers_in.size() != 13) throw InputError("a body enters with 13 numbers");
    physics::Entry entry{.velocity_m_s = take_vector(numbers_in, 7), .angular_velocity_rad_s = take_vector(numbers_in, 10)};
    entry.pose.position_m = take_vector(numbers_in, 0);
    for (std::size_t k = 0; k < 4; ++k) entry.pose.rotation[k] = numbers_in[3 + k];
    get_world().get_world().add(body, entry);
    return 0;
  });
}
WEB_EXPORT(int, web_take_out_body)(int body) {
  return run([&] { return get_world().get_world().remove(body), 0; });
}
