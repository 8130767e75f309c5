#include "jobs/front/explore/scenes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "jobs/front/explore/names.hpp"

namespace carillon::explore {
namespace {

constexpr double kGap = 0.25;      // gap between neighbours / mean width
constexpr double kView = 1.6;      // distance of the listener / diagonal of the row
constexpr double kNearestM = 0.3;  // minimum distance of the listener
constexpr double kStrikeS = 0.15;  // interval between blows of the probe
constexpr const char* kMallet = "hard-wood";

base::Json to_json(const Vec3& v) {
  base::Json list = base::Json::array();
  for (const double x : v) list.append(x);
  return list;
}

/// Bounding box of the surface in world axes, relative to the origin of the mesh.
struct Box {
  Vec3 low, high;
};
Box find_box(const BankFacts& facts, Up up) {
  const Vec3 &low = facts.low_m, &high = facts.high_m;
  if (up == Up::kZ) return {low, high};
  return {{low[0], -high[2], low[1]}, {high[0], -low[2], high[1]}};  // rotation by 90 degrees about x
}

}  // namespace

base::Json make_row(const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts, Up up) {
  base::Json scene = base::Json::object();
  scene["duration_s"] = 1.0;
  std::set<std::string> taken;
  double x = 0.0, height = 0.0, depth = 0.0, last = 0.0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const Box box = find_box(*facts[i], up);
    const double width = box.high[0] - box.low[0];
    if (i > 0) x += kGap * 0.5 * (width + last);
    base::Json body = base::Json::object();
    const std::string stem = cut_name(files[i].stem().string());
    std::string name = stem;
    for (int k = 2; !taken.insert(name).second; ++k) name = fmt::format("{} {}", stem, k);
    body["name"] = name;
    body["bank"] = files[i].string();
    body["fixed"] = true;
    body["position_m"] = to_json({x - box.low[0], -0.5 * (box.low[1] + box.high[1]), -box.low[2]});
    if (up == Up::kY) body["rotation_deg"] = to_json({90.0, 0.0, 0.0});
    scene["bodies"].append(body);
    x += width;
    last = width;
    height = std::max(height, box.high[2] - box.low[2]);
    depth = std::max(depth, box.high[1] - box.low[1]);
  }
  const double away = std::max(kNearestM, kView * std::hypot(x, height, depth));
  scene["listener"]["position_m"] = to_json({0.5 * x, -0.94 * away, 0.5 * height + 0.34 * away});
  scene["listener"]["look_at_m"] = to_json({0.5 * x, 0.0, 0.5 * height});
  return scene;
}

base::Json make_probe(base::Json scene, const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts) {
  for (const char* happening : {"strikes", "joints", "cords", "gravity_m_s2", "variation"}) scene.erase(happening);
  double time_s = 0.05;
  for (std::size_t i = 0; i < scene["bodies"].size(); ++i) {
    base::Json& body = scene["bodies"][i];
    body["fixed"] = true;
    body["bank"] = files[i].string();
    for (const char* motion : {"velocity_m_s", "angular_velocity_rad_s"}) body.erase(motion);
    base::Json strike = base::Json::object();
    strike["time_s"] = time_s;
    strike["body"] = body["name"];
    strike["point_m"] = to_json(facts[i]->loudest_m);
    strike["mallet"] = kMallet;
    scene["strikes"].append(strike);
    time_s += kStrikeS;
  }
  scene["duration_s"] = time_s;
  return scene;
}

}  // namespace carillon::explore
