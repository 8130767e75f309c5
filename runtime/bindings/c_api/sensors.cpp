// Sensors of the C interface.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "runtime/bindings/c_api/calls.hpp"
#include "runtime/bindings/c_api/structures.hpp"
#include "runtime/synth/sensor.hpp"

namespace carillon::c_api {

template <>
carillon_sensor make_default() {
  const synth::SensorSettings ours;
  carillon_sensor sensor{};
  std::copy(ours.barycentric.begin(), ours.barycentric.end(), sensor.barycentric);
  std::copy(ours.direction.begin(), ours.direction.end(), sensor.direction);
  sensor.buffer_s = ours.buffer_s;
  return sensor;
}

static_assert(CARILLON_STRAIN == static_cast<int>(synth::Quantity::kStrain) &&
              CARILLON_DISPLACEMENT == static_cast<int>(synth::Quantity::kDisplacement));

}  // namespace carillon::c_api

using namespace carillon;
using namespace carillon::c_api;

extern "C" {

void carillon_sensor_init_sized(carillon_sensor* sensor, size_t size) { init(sensor, size); }

carillon_status carillon_add_sensor(carillon_synth* synth, const carillon_bank* bank, const carillon_sensor* sensor, int32_t* number,
                                    char* message, size_t message_size) {
  const auto given = read(sensor);
  if (number != nullptr) *number = -1;
  if (synth == nullptr || bank == nullptr || number == nullptr || !given)
    return refuse("carillon_add_sensor: synth, bank and number must not be NULL, sensor must be initialised", message, message_size);
  return run(message, message_size, [&] {
    if (given->quantity < 0 || given->quantity >= std::ssize(synth::kQuantityNames))
      throw InputError("sensor: quantity " + std::to_string(given->quantity) + " is no carillon_quantity");
    *number = synth->synthesiser.add_sensor(given->body, bank->bank,
                                            {.triangle = given->triangle,
                                             .barycentric = to_vector(given->barycentric),
                                             .direction = to_vector(given->direction),
                                             .quantity = static_cast<synth::Quantity>(given->quantity),
                                             .rate_hz = given->rate_hz,
                                             .is_held = given->held != 0,
                                             .buffer_s = given->buffer_s});
  });
}

int32_t carillon_read_sensor(carillon_synth* synth, int32_t number, double* out, int32_t samples) {
  synth::Sensor* sensor = synth == nullptr ? nullptr : synth->synthesiser.find_sensor(number);
  if (sensor == nullptr || out == nullptr || samples <= 0) return 0;
  return static_cast<int32_t>(sensor->read(std::span(out, static_cast<std::size_t>(samples))));
}

double carillon_sensor_begin_s(const carillon_synth* synth, int32_t number) {
  const synth::Sensor* sensor = synth == nullptr ? nullptr : synth->synthesiser.find_sensor(number);
  return sensor == nullptr ? 0.0 : sensor->get_begin_s();
}

int64_t carillon_sensor_lost(const carillon_synth* synth, int32_t number) {
  const synth::Sensor* sensor = synth == nullptr ? nullptr : synth->synthesiser.find_sensor(number);
  return sensor == nullptr ? 0 : sensor->get_lost();
}

}  // extern "C"
