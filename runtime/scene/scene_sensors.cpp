// The key "sensors" of a scene, and the place of a sensor on a bank.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "runtime/bank/nearest.hpp"
#include "runtime/base/error.hpp"
#include "runtime/scene/scene_bodies.hpp"

namespace carillon::scene {
namespace {

using base::Limits;

constexpr std::size_t kMaxSensors = 1000;

const std::vector<std::string> kQuantities(synth::kQuantityNames.begin(), synth::kQuantityNames.end());

const base::Keys<SceneSensor> kSensor{
    {"name", "required", "unique"},
    {"body", "required", "name of a body"},
    {"point_m", &SceneSensor::point_m, base::within(kFarthestM),
     "or `triangle`: point near the surface, in the axes of the mesh, at most a quarter of the body's extent off"},
    {"triangle", &SceneSensor::triangle, Limits{0, std::numeric_limits<std::int32_t>::max()}, "or centre of this triangle of the bank"},
    {"direction", "required", "in the axes of the mesh, of any length; strain: axis of the gauge, projected onto the surface"},
    {"quantity", &SceneSensor::quantity, kQuantities, "m/s2, m/s, m, or 1 for strain"}};

}  // namespace

void parse_sensors(base::Object& root, const Names& names, Scene& scene) {
  std::vector<base::Object> sensors = root.objects("sensors");
  if (sensors.size() > kMaxSensors)
    root.fail("sensors", fmt::format("has {} sensors, at most {} are allowed", sensors.size(), kMaxSensors));
  if (sensors.empty() && root.has("sensor_rate_hz")) root.fail("sensor_rate_hz", "needs \"sensors\"; give them, too");
  std::set<std::string> taken;
  for (base::Object& object : sensors) {
    SceneSensor sensor;
    sensor.place = object.find_place("");
    sensor.name = object.string("name");
    if (sensor.name.empty() || !taken.insert(sensor.name).second)
      object.fail("name", fmt::format("\"{}\" is empty or taken; give every sensor a name of its own", sensor.name));
    sensor.body = find_body(object, names);
    kSensor.read(object, sensor);
    sensor.direction = read_direction(object, "direction");
    if (sensor.point_m.has_value() == sensor.triangle.has_value())
      object.fail(sensor.point_m ? "triangle" : "point_m", "give the place: either \"point_m\" or \"triangle\"");
    object.finish();
    scene.sensors.push_back(std::move(sensor));
  }
}

void describe_sensor_keys(std::vector<base::KeyTable>& tables) { kSensor.describe(tables.emplace_back(base::KeyTable{"sensor", {}})); }

synth::SensorSettings locate_sensor(const Scene& scene, const SceneSensor& sensor, const bank::Bank& bank) {
  const SceneBody& body = scene.bodies[sensor.body];
  synth::SensorSettings settings{.direction = sensor.direction,
                                 .quantity = sensor.quantity,
                                 .rate_hz = static_cast<double>(scene.sensor_rate_hz.value_or(0)),
                                 .is_held = body.spec.fixed};
  if (sensor.triangle) {
    if (*sensor.triangle >= std::ssize(bank.triangles))
      throw InputError(fmt::format("{}: \"triangle\" is {}, and \"{}\" has {}; the first is 0", sensor.place, *sensor.triangle, body.name,
                                   bank.triangles.size()));
    settings.triangle = *sensor.triangle;
    return settings;
  }
  const bank::NearestPlace nearest = bank::find_nearest(bank, *sensor.point_m);
  Vec3 low = bank.vertices_m.front(), high = low;
  for (const Vec3& vertex : bank.vertices_m)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  if (nearest.triangle < 0 || !(nearest.distance_m <= bank::kFarthestShare * calc_length(high - low)))
    throw InputError(
        fmt::format("{}: \"point_m\" is {:.4g} m away from \"{}\"; its nearest point is [{:.6g}, {:.6g}, {:.6g}] in metres of the mesh",
                    sensor.place, nearest.distance_m, body.name, nearest.point_m[0], nearest.point_m[1], nearest.point_m[2]));
  settings.triangle = nearest.triangle;
  settings.barycentric = nearest.barycentric;
  return settings;
}

}  // namespace carillon::scene
