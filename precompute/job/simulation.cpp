#include "precompute/job/simulation.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <set>

#include "precompute/job/read_body.hpp"
#include "runtime/base/ranges.hpp"
#include "runtime/material/read_material.hpp"

namespace carillon::job {
namespace {

namespace fs = std::filesystem;
using base::read_vector;
using base::read_within;

constexpr double kFarthestM = 1e4, kMaxSpeedMs = 343.0;  // of sound in air
constexpr double kMaxSpinRadS = 1e5, kMaxGravity = 1e5;
constexpr double kMaxSeconds = 3600.0, kMinStepS = 1e-12, kMaxStepS = 1e-3;
constexpr double kMinLengthM = 1e-6, kMaxMassKg = 1e9;
constexpr int kMaxCells = 2000, kMaxBendMode = 20;
constexpr std::size_t kMaxBodies = 100, kMaxBlows = 10000, kMaxRows = 100'000, kMaxGroups = 1000, kMaxMicrophones = 16;
/// Where a law of loss that is not Rayleigh's has the same loss as the one that is simulated.
constexpr double kFitLowHz = 200.0, kFitHighHz = 5000.0;

NodeGroup read_group(base::Object group) {
  NodeGroup result;
  result.place = group.find_place("");
  if (group.has("node_set") == group.has("box_m"))
    group.fail(
        "", "nodes are a \"node_set\" (a name of the mesh) or those in a \"box_m\" ({\"min\": [x, y, z], \"max\": [x, y, z]}); give one");
  if (group.has("node_set")) {
    result.node_set = group.string("node_set");
    if (result.node_set.empty()) group.fail("node_set", "is empty; give the name of a set of the mesh");
  } else {
    result.box_m = read_box(group.object("box_m"));
  }
  return result;
}

/// Names of node sets, objects, or a list of both.
std::vector<NodeGroup> read_groups(base::Object& body, std::string_view key) {
  std::vector<NodeGroup> list;
  for (base::Entry& entry : body.entries(key, kMaxGroups)) {
    if (entry.object) {
      list.push_back(read_group(*entry.object));
      entry.object->finish();
    } else {
      list.push_back({entry.text, {}, entry.place});
    }
  }
  return list;
}

std::vector<Drive> read_drives(base::Object& body) {
  std::vector<Drive> drives;
  for (base::Object& object : body.objects("drive")) {
    Drive& drive = drives.emplace_back();
    drive.nodes = read_group(object);
    for (const std::vector<double>& row : object.number_rows("path", 4, kMaxRows)) {
      const std::array<double, 4> at{row[0], row[1], row[2], row[3]};
      for (const double x : at)
        if (!(std::abs(x) <= kFarthestM))
          object.fail("path", fmt::format("{:g} is out of range; give metres and seconds up to {:g}", x, kFarthestM));
      if (!drive.path.empty()) {
        const auto& last = drive.path.back();
        if (!(at[0] > last[0]))
          object.fail("path", fmt::format("time {:g} follows {:g}; give rows [t, x, y, z] in order of time", at[0], last[0]));
        const double speed = norm({at[1] - last[1], at[2] - last[2], at[3] - last[3]}) / (at[0] - last[0]);
        if (speed > kMaxSpeedMs)
          object.fail("path", fmt::format("moves at {:.4g} m/s after {:g} s, faster than sound in air; give {:g} m/s at most", speed,
                                          last[0], kMaxSpeedMs));
      } else if (at[1] != 0 || at[2] != 0 || at[3] != 0) {
        object.fail("path", "is a displacement from where the nodes start: its first row is [t, 0, 0, 0]");
      }
      drive.path.push_back(at);
    }
    if (drive.path.size() < 2) object.fail("path", "has one row; a motion needs two or more");
    if (object.has("release_s")) drive.release_s = read_within(object, "release_s", 0.0, kMaxSeconds);
    object.finish();
  }
  return drives;
}

Bend read_bend(base::Object& object) {
  Bend bend;
  bend.place = object.find_place("");
  const bool is_group = object.has("node_set") || object.has("box_m");
  if ((object.has("mode") ? 1 : 0) + (object.has("force_n") ? 1 : 0) + (is_group ? 1 : 0) + (object.has("table_m") ? 1 : 0) != 1)
    object.fail("",
                "a body is bent by a \"mode\" (with \"amplitude_m\"), a \"force_n\" (with \"point_m\"), a \"node_set\" or \"box_m\" (with "
                "\"displacement_m\"), or a \"table_m\" of rows [x, y, z, ux, uy, uz]; give one");
  if (object.has("mode")) {
    bend.mode = static_cast<int>(*object.integer_if("mode", 1, kMaxBendMode));
    bend.amplitude_m = read_within(object, "amplitude_m", -kFarthestM, kFarthestM);
    if (bend.amplitude_m == 0) object.fail("amplitude_m", "is 0, and bends nothing; give the largest displacement of the mode");
  } else if (object.has("force_n")) {
    bend.force_n = object.numbers<3>("force_n");
    bend.point_m = read_vector(object, "point_m", {}, kFarthestM);
  } else if (is_group) {
    bend.displacement_m = object.numbers<3>("displacement_m");
    for (const double x : bend.displacement_m)
      if (!(std::abs(x) <= kFarthestM)) object.fail("displacement_m", fmt::format("{:g} is out of range; give metres", x));
    bend.nodes = read_group(object);
  } else {
    for (const std::vector<double>& row : object.number_rows("table_m", 6, kMaxRows)) {
      for (const double x : row)
        if (!(std::abs(x) <= kFarthestM)) object.fail("table_m", fmt::format("{:g} is out of range; give metres", x));
      bend.table.push_back({row[0], row[1], row[2], row[3], row[4], row[5]});
    }
  }
  object.finish();
  return bend;
}

std::vector<Bend> read_bends(base::Object& body) {
  std::vector<Bend> bends;
  for (base::Entry& entry : body.entries("bend", kMaxGroups)) {
    if (!entry.object) body.fail("bend", "is an object, or a list of objects");
    bends.push_back(read_bend(*entry.object));
  }
  if (bends.size() > 1 && std::any_of(bends.begin(), bends.end(), [](const Bend& one) { return one.mode > 0; }))
    body.fail("bend", "has a mode, which is a whole shape; give it alone");
  return bends;
}

double read_scene_length(base::Object& object, std::string_view key) { return read_within(object, key, kMinLengthM, kFarthestM); }

Sheet read_sheet(base::Object object) {
  Sheet sheet;
  sheet.thickness_m = read_scene_length(object, "thickness_m");
  sheet.shape = object.choice("shape", {"rectangle", "disc"});
  if (sheet.shape == "disc") {
    sheet.radius_m = read_scene_length(object, "radius_m");
  } else {
    sheet.length_m = read_scene_length(object, "length_m");
    sheet.width_m = read_scene_length(object, "width_m");
    sheet.bow_m = read_within(object, "bow_m", 0.0, 0.0, kFarthestM);
    if (sheet.bow_m > 0.4 * sheet.length_m)
      object.fail("bow_m", fmt::format("is more than 0.4 of the length; give {:g} at most", 0.4 * sheet.length_m));
  }
  if (auto cells = object.integer_if("cells", 2, kMaxCells)) sheet.cells = static_cast<int>(*cells);
  object.finish();
  return sheet;
}

Material read_solid(base::Object& object, std::vector<std::string>& warnings) {
  const std::array<double, 2> band{20.0, 20000.0};
  Material material = material::read_material(object, "material", band, warnings);
  if (material.orthotropic) object.fail("material", "is orthotropic, and large deformation is computed of isotropic solids only");
  if (material.law == material::DampingLaw::rayleigh) return material;
  const Material fitted = make_rayleigh(material, kFitLowHz, kFitHighHz);
  warnings.push_back(
      fmt::format("{}: the loss of the material is simulated as Rayleigh damping with the same loss at {:g} and {:g} Hz: alpha1 {:.3g} s, "
                  "alpha2 {:.3g} 1/s",
                  object.find_place("material"), kFitLowHz, kFitHighHz, fitted.alpha1_s, fitted.alpha2_per_s));
  return fitted;
}

void read_form(base::Object& object, SimulatedBody& body) {
  int forms = 0;
  for (const char* key : {"mesh", "body", "shape", "sheet"}) forms += object.has(key) ? 1 : 0;
  if (forms != 1)
    object.fail("", "a body is one of \"mesh\" (a file), \"body\" or \"shape\" (as in a job of modes), and \"sheet\"; give one");
  if (object.has("mesh")) {
    body.mesh = object.path("mesh");
    body.mesh_scale = read_within(object, "mesh_scale", 1.0, 1e-9, 1e6);
  } else if (object.has("shape")) {
    body.body = read_short_shape(object.object("shape"));
  } else if (object.has("body")) {
    body.body = read_body(object.object("body"));
  } else {
    body.sheet = read_sheet(object.object("sheet"));
  }
  if (!body.sheet) {
    body.element = object.choice_or("element", {"T4", "T10"}, "T10") == "T4" ? Element::T4 : Element::T10;
  } else if (object.has("element")) {
    object.fail("element", "is for solids; a sheet has elements of its own");
  }
  if (body.sheet)
    body.hinged = read_groups(object, "hinged");
  else if (object.has("hinged"))
    object.fail("hinged", "is for sheets; a solid turns about fixed nodes that lie on a line");
}

SimulatedBody read_simulated_body(base::Object& object, std::vector<std::string>& warnings) {
  SimulatedBody body;
  body.name = object.string("name");
  body.place = object.find_place("");
  read_form(object, body);
  object.choice_or("model", {"stvk"}, "stvk");
  body.material = read_solid(object, warnings);
  body.fixed = read_groups(object, "fixed");
  body.drives = read_drives(object);
  body.bends = read_bends(object);
  body.position_m = read_vector(object, "position_m", {}, kFarthestM);
  body.rotation_deg = read_vector(object, "rotation_deg", {}, 1e6);
  body.velocity_m_s = read_vector(object, "velocity_m_s", {}, kMaxSpeedMs);
  body.angular_velocity_rad_s = read_vector(object, "angular_velocity_rad_s", {}, kMaxSpinRadS);
  body.sounds = object.boolean_or("sounds", true);
  object.finish();
  return body;
}

Striker read_striker(base::Object& object) {
  Striker striker;
  striker.place = object.find_place("");
  striker.ball.radius_m = read_scene_length(object, "sphere_m");
  striker.ball.mass_kg = read_within(object, "mass_kg", 1e-9, kMaxMassKg);
  striker.ball.position_m = read_vector(object, "position_m", {}, kFarthestM);
  striker.ball.velocity_m_s = read_vector(object, "velocity_m_s", {}, kMaxSpeedMs);
  striker.ball.spin_rad_s = read_vector(object, "angular_velocity_rad_s", {}, kMaxSpinRadS);
  object.finish();
  return striker;
}

Obstacle read_obstacle(base::Object& object) {
  Obstacle obstacle;
  obstacle.place = object.find_place("");
  int forms = 0;
  for (const char* key : {"plane", "sphere", "box"}) forms += object.has(key) ? 1 : 0;
  if (forms != 1) object.fail("", "an obstacle is a \"plane\", a \"sphere\" or a \"box\"; give one");
  if (auto plane = object.object_if("plane")) {
    PlaneObstacle made{read_vector(*plane, "point_m", {}, kFarthestM), read_vector(*plane, "normal", {0, 0, 1}, 1e100)};
    const double length = norm(made.normal);
    if (!(length > 1e-100)) plane->fail("normal", "is 0; give the direction to the free side");
    made.normal = (1.0 / length) * made.normal;
    plane->finish();
    obstacle.form = made;
  } else if (auto sphere = object.object_if("sphere")) {
    obstacle.form = BallObstacle{read_vector(*sphere, "centre_m", {}, kFarthestM), read_scene_length(*sphere, "radius_m")};
    sphere->finish();
  } else {
    const std::array<Vec3, 2> box = read_box(object.object("box"));
    obstacle.form = BoxObstacle{box[0], box[1]};
  }
  object.finish();
  return obstacle;
}

Blow read_blow(base::Object& object, const std::vector<SimulatedBody>& bodies) {
  Blow blow;
  blow.place = object.find_place("");
  const std::string name = object.string("body");
  const auto body = std::find_if(bodies.begin(), bodies.end(), [&](const SimulatedBody& one) { return one.name == name; });
  if (body == bodies.end()) {
    std::vector<std::string> names;
    for (const SimulatedBody& one : bodies) names.push_back(one.name);
    const std::string near = base::find_nearest(name, names);
    object.fail("body", fmt::format("there is no body \"{}\"{}", name, near.empty() ? "" : fmt::format(", did you mean \"{}\"?", near)));
  }
  blow.body = body - bodies.begin();
  blow.time_s = read_within(object, "time_s", 0.0, kMaxSeconds);
  blow.point_m = read_vector(object, "point_m", {}, kFarthestM);
  blow.impulse_n_s = object.numbers<3>("impulse_n_s");
  blow.duration_s = read_within(object, "duration_s", 1e-4, 1e-7, kMaxSeconds);
  if (blow.time_s < 0.5 * blow.duration_s)
    object.fail("time_s", "is the middle of the blow, which would begin before the simulation; give half of its duration or more");
  object.finish();
  return blow;
}

Receivers read_receivers(base::Object& root) {
  Receivers receivers;
  if (auto listener = root.object_if("listener")) {
    receivers.position_m = read_vector(*listener, "position_m", receivers.position_m, kFarthestM);
    receivers.ear_distance_m = read_within(*listener, "ear_distance_m", receivers.ear_distance_m, 0.0, 10.0);
    receivers.cardioid = read_within(*listener, "directional", 0.0, 0.0, 1.0);
    if (listener->has("look_at_m") && listener->has("facing"))
      listener->fail("look_at_m", "says the same thing as \"facing\"; keep one of them");
    const std::string key = listener->has("look_at_m") ? "look_at_m" : "facing";
    const Vec3 direction = key == "look_at_m" ? read_vector(*listener, key, {}, kFarthestM) - receivers.position_m
                                              : read_vector(*listener, key, receivers.facing, kFarthestM);
    if (!(norm(direction) > 1e-9)) listener->fail(key, "gives the listener no direction to look in; name another place or direction");
    receivers.facing = normalise(direction);
    listener->finish();
  }
  if (root.has("microphones")) {
    if (root.has("listener")) root.fail("microphones", "takes the place of \"listener\"; keep one of them");
    for (const std::vector<double>& row : root.number_rows("microphones", 3, kMaxMicrophones))
      receivers.microphones_m.push_back({row[0], row[1], row[2]});
  }
  return receivers;
}

void check_names(base::Object& root, const std::vector<SimulatedBody>& bodies) {
  if (bodies.empty() || bodies.size() > kMaxBodies) root.fail("bodies", fmt::format("give 1 to {} bodies", kMaxBodies));
  std::set<std::string> names;
  for (const SimulatedBody& body : bodies) {
    if (body.name.empty() || body.name.size() > 200) throw InputError(fmt::format("{}: a name has 1 to 200 bytes", body.place));
    if (!names.insert(body.name).second)
      throw InputError(fmt::format("{}: two bodies are called \"{}\"; give each its own name", body.place, body.name));
  }
}

void read_outputs(base::Object& root, SimulationSpec& spec) {
  for (const SimulationOutput& output : kSimulationOutputs)
    if (root.has(output.key)) spec.*output.file = root.path(output.key);
  if (const SimulationOutput* output = find_overwriting_output(spec))
    root.fail(output->key, "would overwrite another file of this job; choose another name");
}

SimulationSpec read_root(base::Object root, const fs::path& file) {
  SimulationSpec spec;
  spec.file = file;
  base::Object job = root.object("simulate");
  spec.duration_s = read_within(job, "duration_s", 1e-6, kMaxSeconds);
  if (auto rate = job.integer_if("sample_rate_hz", 8000, 192'000)) spec.sample_rate_hz = static_cast<int>(*rate);
  if (job.has("step_s") && !job.has_string("step_s")) spec.step_s = read_within(job, "step_s", kMinStepS, kMaxStepS);
  if (job.has_string("step_s")) job.choice("step_s", {"automatic"});
  spec.gravity_m_s2 = read_vector(job, "gravity_m_s2", {}, kMaxGravity);
  spec.settle_s = read_within(job, "settle_s", 0.0, 0.0, kMaxSeconds);
  for (base::Object& body : job.objects("bodies")) spec.bodies.push_back(read_simulated_body(body, spec.warnings));
  check_names(job, spec.bodies);
  for (base::Object& striker : job.objects("strikers")) spec.strikers.push_back(read_striker(striker));
  for (base::Object& obstacle : job.objects("obstacles")) spec.obstacles.push_back(read_obstacle(obstacle));
  for (base::Object& blow : job.objects("impulses")) spec.blows.push_back(read_blow(blow, spec.bodies));
  if (spec.blows.size() > kMaxBlows) job.fail("impulses", fmt::format("give {} at most", kMaxBlows));
  if (auto contact = job.object_if("contact")) {
    spec.contact.stiffness = read_within(*contact, "stiffness", spec.contact.stiffness, 1e-6, 100.0);
    spec.contact.restitution = read_within(*contact, "restitution", spec.contact.restitution, 0.05, 1.0);
    spec.contact.friction = read_within(*contact, "friction", spec.contact.friction, 0.0, 10.0);
    contact->finish();
  }
  spec.receivers = read_receivers(job);
  const std::string radiation = job.choice_or("radiation", {"kirchhoff", "rayleigh", "paper2001"}, "kirchhoff");
  spec.radiation = radiation == "kirchhoff"  ? SurfaceSound::kirchhoff
                   : radiation == "rayleigh" ? SurfaceSound::rayleigh
                                             : SurfaceSound::paper2001;
  spec.visibility = job.boolean_or("visibility", spec.radiation != SurfaceSound::kirchhoff);
  if (spec.visibility && spec.radiation == SurfaceSound::kirchhoff)
    job.fail("visibility", "hides triangles, and \"kirchhoff\" needs all of a closed surface; take \"rayleigh\", or leave it out");
  spec.high_pass_hz = read_within(job, "high_pass_hz", 20.0, 0.0, 1000.0);
  spec.motion_hz = read_within(job, "motion_hz", 60.0, 1.0, spec.sample_rate_hz);
  job.finish();
  read_outputs(root, spec);
  spec.resources = read_resources(root);
  root.finish();
  return spec;
}

}  // namespace

bool is_simulation(std::string_view text) {
  try {
    return base::parse_document(text, "job").root().has("simulate");
  } catch (const InputError&) {
    return false;
  }
}

SimulationSpec parse_simulation(std::string_view text, const fs::path& file) {
  return read_root(base::parse_document(text, file).root(), file);
}

void check_has_output(const SimulationSpec& spec, const std::string& place) {
  std::string keys;
  for (const SimulationOutput& output : kSimulationOutputs) {
    if (!(spec.*output.file).empty()) return;
    keys += fmt::format("{}\"{}\"", keys.empty() ? "" : &output == std::end(kSimulationOutputs) - 1 ? " or " : ", ", output.key);
  }
  throw InputError(fmt::format("{}: nothing is to be written; name a file with {}", place, keys));
}

const SimulationOutput* find_overwriting_output(const SimulationSpec& spec) {
  std::set<fs::path> files{fs::absolute(spec.file).lexically_normal()};
  for (const auto& body : spec.bodies) {
    if (!body.mesh.empty()) files.insert(body.mesh);
    if (body.body && !body.body->surface.empty()) files.insert(body.body->surface);
  }
  for (const SimulationOutput& output : kSimulationOutputs) {
    const fs::path& file = spec.*output.file;
    if (!file.empty() && !files.insert(file.lexically_normal()).second) return &output;
  }
  return nullptr;
}

Material make_rayleigh(const Material& material, double low_hz, double high_hz) {
  // c(w) = alpha1 w^2 + alpha2 at both ends.
  const double low = std::pow(2.0 * std::numbers::pi * low_hz, 2), high = std::pow(2.0 * std::numbers::pi * high_hz, 2);
  const double c_low = material.calc_damping_per_s(low), c_high = material.calc_damping_per_s(high);
  Material result = material;
  result.law = material::DampingLaw::rayleigh;
  result.alpha1_s = std::max(0.0, (c_high - c_low) / (high - low));
  result.alpha2_per_s = std::max(0.0, c_low - result.alpha1_s * low);
  return result;
}

}  // namespace carillon::job
