#include "precompute/job/simulation.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>

#include "precompute/job/keys.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/base/ranges.hpp"
#include "runtime/material/read_material.hpp"

namespace carillon::job {
namespace {

namespace fs = std::filesystem;
using base::Limits;
using base::required;
using base::within;

constexpr double kFarthestM = 1e4, kMaxSpeedMs = 343.0;  // of sound in air
constexpr double kMaxSeconds = 3600.0, kMinStepS = 1e-12, kMaxStepS = 1e-3;
constexpr Limits kPlace = within(kFarthestM), kSpeed = within(kMaxSpeedMs), kSpin = within(1e5);
constexpr Limits kExtent{1e-6, kFarthestM}, kTime{0.0, kMaxSeconds};
constexpr std::size_t kMaxBodies = 100, kMaxBlows = 10000, kMaxRows = 100'000, kMaxGroups = 1000, kMaxMicrophones = 16;
/// Other damping laws are replaced by Rayleigh damping with the same loss at these frequencies.
constexpr double kFitLowHz = 200.0, kFitHighHz = 5000.0;

const std::vector<std::string> kSoundNames{"kirchhoff", "rayleigh", "paper2001"};  // in the order of SurfaceSound

const base::Keys<SimulationSpec> kSimulation{
    {"duration_s", &SimulationSpec::duration_s, Limits{1e-6, kMaxSeconds}, "simulated time", required},
    {"sample_rate_hz", &SimulationSpec::sample_rate_hz, Limits{8000, 192'000}, "sample rate of the sound"},
    {"step_s", "`\"automatic\"`", "upper limit of the time step; the stability limit still applies"},
    {"gravity_m_s2", &SimulationSpec::gravity_m_s2, within(1e5), "acceleration of gravity"},
    {"settle_s", &SimulationSpec::settle_s, kTime, "gravity grows from 0 in this time, to avoid a jerk of hanging bodies"},
    {"bodies", "required", "1 to 100 bodies"},
    {"strikers", "none", "rigid balls in free flight"},
    {"obstacles", "none", "rigid bodies at rest, each a `plane`, a `sphere` or a `box`"},
    {"impulses", "none", "blows on bodies"},
    {"contact", "none", "parameters of all contacts"},
    {"listener", "1.5 m in front", "two ears"},
    {"microphones", "none", "replaces `listener`: 1 to 16 positions `[x, y, z]`"},
    {"radiation", &SimulationSpec::radiation, kSoundNames, "radiation formula ([E14](../equations.md))"},
    {"visibility", "false; true without `\"kirchhoff\"`",
     "triangles that face away from a receiver or are hidden by a body, striker or obstacle are silent; not with `\"kirchhoff\"`"},
    {"high_pass_hz", &SimulationSpec::high_pass_hz, Limits{0, 1000}, "high-pass of the sound; not for `\"paper2001\"`, which has its own"},
    {"motion_hz", "60", "frames per second of `motion`; 1 to `sample_rate_hz`"}};
const base::Keys<SimulatedBody> kBody{
    {"name", &SimulatedBody::name, "unique, at most 200 bytes", required},
    {"mesh", "one form", "file of tetrahedra"},
    {"mesh_scale", "1", "metres per unit of the mesh file"},
    {"shape", "one form", "a parametric shape, as in [a job of modes](make-a-bank.md)"},
    {"body", "one form", "a meshed body, as in [a job of modes](make-a-bank.md)"},
    {"sheet", "one form", "a thin sheet"},
    {"element", "`\"T10\"`", "of solids, or `\"T4\"`, which is far too stiff in bending ([which](choose-accuracy.md#element-and-mesh))"},
    {"model", "`\"stvk\"`", "Saint Venant and Kirchhoff: large rotation, moderate strain"},
    {"material", "required", "isotropic; losses other than Rayleigh's are fitted by Rayleigh damping at 200 and 5000 Hz"},
    {"fixed", "none", "node groups without displacement; of a sheet: clamped"},
    {"hinged", "none", "node groups of a sheet without displacement that rotate freely"},
    {"drive", "none", "list of nodes that follow a path"},
    {"bend", "none", "[initial bending](#bend-it-and-let-it-go)"},
    {"position_m", &SimulatedBody::position_m, kPlace, "of the mesh's origin"},
    {"rotation_deg", &SimulatedBody::rotation_deg, within(1e6), "about the fixed axes x, then y, then z"},
    {"velocity_m_s", &SimulatedBody::velocity_m_s, kSpeed, "initial velocity of the centre of mass"},
    {"angular_velocity_rad_s", &SimulatedBody::angular_velocity_rad_s, kSpin, "initial angular velocity about the centre of mass"},
    {"sounds", &SimulatedBody::sounds, "false: silent, but still hides other bodies (`visibility`)"}};
const base::Keys<Sheet> kSheet{{"shape",
                                &Sheet::shape,
                                {"rectangle", "disc"},
                                "in the plane z = 0, with node sets `x-min`, `x-max`, `y-min`, `y-max`, `rim`, or `rim`, `centre`",
                                required},
                               {"thickness_m", &Sheet::thickness_m, kExtent, "thickness", required},
                               {"cells", &Sheet::cells, Limits{2, 2000}, "cells along the longer side or the diameter"}};
const base::Keys<Sheet> kRectangle{
    {"length_m", &Sheet::length_m, kExtent, "of a rectangle, along x", required},
    {"width_m", &Sheet::width_m, kExtent, "of a rectangle, along y", required},
    {"bow_m", &Sheet::bow_m, Limits{0, kFarthestM}, "of a rectangle: stress-free rise of the middle over its ends at -x and +x"}};
const base::Keys<Sheet> kDisc{{"radius_m", &Sheet::radius_m, kExtent, "of a disc", required}};
const base::Keys<Drive> kDrive{{"node_set", "one of two", "name of the driven nodes"},
                               {"box_m", "one of two", "box of the driven nodes"},
                               {"path", "required", "rows `[t, x, y, z]` of displacements from the start, smooth between rows"},
                               {"release_s", &Drive::release_s, kTime, "the nodes are free from this time on"}};
const base::Keys<BallStriker> kStriker{{"sphere_m", &BallStriker::radius_m, kExtent, "radius", required},
                                       {"mass_kg", &BallStriker::mass_kg, Limits{1e-9, 1e9}, "mass", required},
                                       {"position_m", &BallStriker::position_m, kPlace, "initial position"},
                                       {"velocity_m_s", &BallStriker::velocity_m_s, kSpeed, "initial velocity"},
                                       {"angular_velocity_rad_s", &BallStriker::spin_rad_s, kSpin, "initial spin"}};
const base::Keys<PlaneObstacle> kPlane{{"point_m", &PlaneObstacle::point_m, kPlace, "a point of the plane"},
                                       {"normal", &PlaneObstacle::normal, within(1e100), "direction to the free side"}};
const base::Keys<BallObstacle> kBall{{"centre_m", &BallObstacle::centre_m, kPlace, "centre"},
                                     {"radius_m", &BallObstacle::radius_m, kExtent, "radius", required}};
const base::Keys<Blow> kBlow{{"body", "required", "name of the body"},
                             {"time_s", &Blow::time_s, kTime, "middle of the blow", required},
                             {"point_m", &Blow::point_m, kPlace, "near the surface, in the axes of the mesh"},
                             {"impulse_n_s", &Blow::impulse_n_s, "impulse, in the axes of the mesh", required},
                             {"duration_s", &Blow::duration_s, Limits{1e-7, kMaxSeconds}, "duration of the raised cosine"}};
const base::Keys<ContactSpec> kContact{
    {"stiffness", &ContactSpec::stiffness, Limits{1e-6, 100}, "penalty over the contact modulus per local edge length"},
    {"restitution", &ContactSpec::restitution, Limits{0.05, 1}, "of a slow impact on a rigid body"},
    {"friction", &ContactSpec::friction, Limits{0, 10}, "Coulomb coefficient"}};
const base::Keys<Receivers> kListener{
    {"position_m", &Receivers::position_m, kPlace, "between the ears"},
    {"look_at_m", "none", "point to look at"},
    {"facing", "`[0, 1, 0]`", "replaces `look_at_m`: direction"},
    {"ear_distance_m", &Receivers::ear_distance_m, Limits{0, 10}, "distance of the ears"},
    {"directional", &Receivers::cardioid, Limits{0, 1}, "q of the directivity (1 - q) + q cos: 0 omnidirectional, 0.5 cardioid"}};

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

/// Node set names and objects, one or a list.
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
    kDrive.read(object, drive);
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
    bend.mode = static_cast<int>(*object.integer_if("mode", 1, 20));
    bend.amplitude_m = base::read_within(object, "amplitude_m", -kFarthestM, kFarthestM);
    if (bend.amplitude_m == 0) object.fail("amplitude_m", "is 0; give the largest displacement of the mode");
  } else if (object.has("force_n")) {
    bend.force_n = object.numbers<3>("force_n");
    bend.point_m = base::read_vector(object, "point_m", {}, kFarthestM);
  } else if (is_group) {
    bend.displacement_m = base::read_vector_within(object, "displacement_m", -kFarthestM, kFarthestM);
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

Sheet read_sheet(base::Object object) {
  Sheet sheet;
  kSheet.read(object, sheet);
  (sheet.shape == "disc" ? kDisc : kRectangle).read(object, sheet);
  if (sheet.bow_m > 0.4 * sheet.length_m)
    object.fail("bow_m", fmt::format("is more than 0.4 of the length; give {:g} at most", 0.4 * sheet.length_m));
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
    body.mesh_scale = base::read_within(object, "mesh_scale", 1.0, 1e-9, 1e6);
  } else if (object.has("shape")) {
    body.body = read_short_shape(object.object("shape"));
  } else if (object.has("body")) {
    body.body = read_body(object.object("body"));
  } else {
    body.sheet = read_sheet(object.object("sheet"));
  }
  if (!body.sheet) {
    if (object.has("element")) body.element = static_cast<Element>(base::read_word(object, "element", kElementNames));
  } else if (object.has("element")) {
    object.fail("element", "is for solids; sheets have their own elements");
  }
  if (body.sheet)
    body.hinged = read_groups(object, "hinged");
  else if (object.has("hinged"))
    object.fail("hinged", "is for sheets; a solid turns about fixed nodes that lie on a line");
}

SimulatedBody read_simulated_body(base::Object& object, std::vector<std::string>& warnings) {
  SimulatedBody body;
  body.place = object.find_place("");
  kBody.read(object, body);
  read_form(object, body);
  object.choice_or("model", {"stvk"}, "stvk");
  body.material = read_solid(object, warnings);
  body.fixed = read_groups(object, "fixed");
  body.drives = read_drives(object);
  body.bends = read_bends(object);
  object.finish();
  return body;
}

Striker read_striker(base::Object& object) {
  Striker striker{object.find_place(""), {}};
  kStriker.read(object, striker.ball);
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
    PlaneObstacle made;
    kPlane.read(*plane, made);
    const double length = norm(made.normal);
    if (!(length > 1e-100)) plane->fail("normal", "is 0; give the direction to the free side");
    made.normal = (1.0 / length) * made.normal;
    plane->finish();
    obstacle.form = made;
  } else if (auto sphere = object.object_if("sphere")) {
    BallObstacle made;
    kBall.read(*sphere, made);
    sphere->finish();
    obstacle.form = made;
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
  kBlow.read(object, blow);
  if (blow.time_s < 0.5 * blow.duration_s)
    object.fail("time_s", "the blow would begin before the simulation; its middle must be at least half of its duration");
  object.finish();
  return blow;
}

Receivers read_receivers(base::Object& root) {
  Receivers receivers;
  if (auto listener = root.object_if("listener")) {
    kListener.read(*listener, receivers);
    receivers.facing = normalise(base::read_facing(*listener, receivers.position_m, receivers.facing, kFarthestM));
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
  kSimulation.read(job, spec);
  if (job.has_string("step_s"))
    job.choice("step_s", {"automatic"});
  else if (job.has("step_s"))
    spec.step_s = base::read_within(job, "step_s", kMinStepS, kMaxStepS);
  for (base::Object& body : job.objects("bodies")) spec.bodies.push_back(read_simulated_body(body, spec.warnings));
  check_names(job, spec.bodies);
  for (base::Object& striker : job.objects("strikers")) spec.strikers.push_back(read_striker(striker));
  for (base::Object& obstacle : job.objects("obstacles")) spec.obstacles.push_back(read_obstacle(obstacle));
  for (base::Object& blow : job.objects("impulses")) spec.blows.push_back(read_blow(blow, spec.bodies));
  if (spec.blows.size() > kMaxBlows) job.fail("impulses", fmt::format("give {} at most", kMaxBlows));
  if (auto contact = job.object_if("contact")) {
    kContact.read(*contact, spec.contact);
    contact->finish();
  }
  spec.receivers = read_receivers(job);
  spec.visibility = job.boolean_or("visibility", spec.radiation != SurfaceSound::kirchhoff);
  if (spec.visibility && spec.radiation == SurfaceSound::kirchhoff)
    job.fail("visibility", "hides triangles, and \"kirchhoff\" needs all of a closed surface; take \"rayleigh\", or leave it out");
  spec.motion_hz = base::read_within(job, "motion_hz", 60.0, 1.0, spec.sample_rate_hz);
  job.finish();
  read_outputs(root, spec);
  spec.resources = read_resources(root);
  root.finish();
  return spec;
}

}  // namespace

std::vector<base::KeyTable> describe_simulation_keys() {
  std::vector<base::KeyTable> tables{{"simulation", {}}, {"simulated body", {}}, {"sheet", {}}, {"drive", {}}};
  kSimulation.describe(tables[0]);
  kStriker.describe(tables[0], "strikers[].");
  kPlane.describe(tables[0], "obstacles[].plane.");
  kBall.describe(tables[0], "obstacles[].sphere.");
  kBlow.describe(tables[0], "impulses[].");
  kContact.describe(tables[0], "contact.");
  kListener.describe(tables[0], "listener.");
  kBody.describe(tables[1]);
  for (const base::Keys<Sheet>* keys : {&kSheet, &kRectangle, &kDisc}) keys->describe(tables[2]);
  kDrive.describe(tables[3]);
  return tables;
}

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
