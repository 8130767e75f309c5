// Method: a node with motion begins a body, which takes the model and the colliders below it; models and colliders without motion are fixed
//   bodies. A body collides by the surface of its model, else by its colliders. The lowest level of static boxes becomes the ground.
// Source: KHR_audio_rigid_bodies (K. Hiner, draft of 2026-08), KHR_physics_rigid_bodies and KHR_implicit_shapes (drafts).
// Deviations: joints, collision filters, kinematic motion, texture of surfaces beyond the roughness, and static friction are left out.
#include "runtime/exchange/gltf_scene.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/exchange/gltf_contacts.hpp"
#include "runtime/exchange/gltf_frames.hpp"
#include "runtime/exchange/gltf_geometry.hpp"
#include "runtime/exchange/silent.hpp"
#include "runtime/material/solids.hpp"

namespace carillon::exchange {
namespace {

constexpr std::size_t kMaxSceneBodies = 1000;
constexpr double kSceneSeconds = 4.0;
constexpr double kLevel = 1e-6;                                     // heights of one level, and directions of one line
constexpr double kLikeShape = 0.01;                                 // extents of a collider and of the surface of a model
constexpr double kFastMS = 300.0, kFastRadS = 1e4, kRoughM = 1e-3;  // limits of scene files
constexpr double kDefaultRoughnessM = 2e-6, kDefaultFriction = 0.6, kDefaultRestitution = 0.0;  // of the extensions

struct Body {
  std::optional<std::size_t> motion, model_node, model;  // nodes; index of the model
  std::vector<std::size_t> colliders;                    // nodes
  bool is_fixed = true, is_in_ground = false;
  std::string name;
  base::Json entry;                                  // of the scene file
  std::optional<GltfContact> restitution, friction;  // of a physics material
  std::vector<std::optional<std::size_t>> kind{};    // physics material and acoustic surface, to compare
  Eigen::Vector3d place = Eigen::Vector3d::Zero();   // z up
};

struct KnownBank {
  std::string file;
  std::vector<Vec3> corners;  // vertices of the surface
};

/// A static box with level faces; world, z up.
struct Slab {
  std::size_t body = 0;
  double top_m = 0.0;
  std::array<double, 2> low{}, high{};  // of its footprint
};

class SceneReader {
 public:
  using Sink = std::function<void(const std::string&, const bank::Bank&)>;
  SceneReader(std::string_view bytes, const std::string& name, const GlbReading& reading, const Sink& sink)
      : file_(gltf::parse(bytes, name)), reading_(&reading), sink_(&sink), root_(file_.root()), graph_(gltf::read_graph(root_)) {}

  GltfScene read() {
    open_extensions();
    find_bodies();
    for (Body& body : bodies_)
      if (body.model || body.motion) make_body(body);
    find_ground();
    for (Body& body : bodies_)
      if (!body.model && !body.motion && !body.is_in_ground) make_body(body);
    settle("restitution", &Body::restitution, 1.0);
    settle("friction", &Body::friction, 10.0);
    write_scene();
    return std::move(made_);
  }

 private:
  void open_extensions() {
    std::optional<base::Object> extensions = root_.object_if("extensions");
    const auto open = [&](const char* extension, const char* key) {
      std::optional<base::Object> own = extensions ? extensions->object_if(extension) : std::nullopt;
      return own ? own->objects(key) : std::vector<base::Object>();
    };
    models_ = open(kExtension, "modalModels");
    materials_ = open(kExtension, "acousticMaterials");
    surfaces_ = open(kExtension, "acousticSurfaces");
    physics_materials_ = open(kPhysicsExtension, "physicsMaterials");
    shapes_ = open(kShapesExtension, "shapes");
    audio_.resize(graph_.nodes.size());
    physics_.resize(graph_.nodes.size());
  }

  std::string name_node(std::size_t n) {
    const std::string name = graph_.nodes[n].has_string("name") ? base::printable(graph_.nodes[n].string_or("name", "")) : "";
    return name.empty() ? fmt::format("nodes[{}]", n) : fmt::format("nodes[{}] (\"{}\")", n, name);
  }
  void warn(std::size_t n, const std::string& text) { made_.warnings.push_back(fmt::format("{}: {}", name_node(n), text)); }

  // ---- bodies of the graph ----

  void find_bodies() {
    const std::size_t count = graph_.nodes.size();
    std::vector<std::optional<std::size_t>> moving(count), sounding(count);  // body of a node by motion, and by a fixed model
    for (const std::size_t n : graph_.in_scene) {
      std::optional<base::Object> extensions = graph_.nodes[n].object_if("extensions");
      if (extensions) {
        audio_[n] = extensions->object_if(kExtension);
        physics_[n] = extensions->object_if(kPhysicsExtension);
        if (extensions->has("EXT_mesh_gpu_instancing")) warn(n, "its instances (EXT_mesh_gpu_instancing) are left out; make them nodes");
      }
      if (const std::optional<std::size_t> parent = graph_.parent[n]) {
        moving[n] = moving[*parent];
        sounding[n] = sounding[*parent];
      }
      if (!camera_ && graph_.nodes[n].has("camera")) camera_ = n;
      if (physics_[n] && physics_[n]->has("motion")) {
        moving[n] = add_body();
        sounding[n].reset();
        bodies_.back().motion = n;
      }
      if (physics_[n] && physics_[n]->has("joint")) warn(n, "its joint is left out: the body moves freely");
      const std::optional<std::size_t> model =
          audio_[n] ? gltf::find_index(*audio_[n], "modalModel", models_.size(), "modal model") : std::nullopt;
      if (model && moving[n] && bodies_[*moving[n]].model) {
        warn(n, "it is part of a body that has a model already; its own is left out");
      } else if (model) {
        if (!moving[n]) sounding[n] = add_body();
        Body& body = bodies_[*(moving[n] ? moving[n] : sounding[n])];
        body.model = model;
        body.model_node = n;
      }
      if (physics_[n] && physics_[n]->has("collider")) {
        const std::size_t body = moving[n] ? *moving[n] : sounding[n] ? *sounding[n] : add_body();
        bodies_[body].colliders.push_back(n);
      }
    }
    if (bodies_.empty())
      throw InputError(fmt::format("{}: its scene has no body: no node has a modal model ({}), a motion or a collider ({})", file_.name(),
                                   kExtension, kPhysicsExtension));
  }

  std::size_t add_body() {
    if (bodies_.size() >= kMaxSceneBodies)
      root_.fail("nodes", fmt::format("there are more than {} bodies; export fewer of them", kMaxSceneBodies));
    bodies_.emplace_back();
    return bodies_.size() - 1;
  }

  std::size_t find_first_node(const Body& body) const {
    return body.motion ? *body.motion : body.model_node ? *body.model_node : body.colliders.front();
  }

  /// A name in the scene file: unique, without control characters.
  std::string choose_name(std::size_t n) {
    constexpr std::size_t kMaxBytes = 150;
    std::string name = graph_.nodes[n].has_string("name") ? graph_.nodes[n].string_or("name", "") : "";
    std::erase_if(name, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    if (name.size() > kMaxBytes) {
      std::size_t end = kMaxBytes;
      while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0) == 0x80) --end;  // whole characters of UTF-8
      name.resize(end);
    }
    if (name.empty()) name = fmt::format("node {}", n);
    std::string unique = name;
    for (int k = 2; !names_.insert(unique).second; ++k) unique = fmt::format("{} {}", name, k);
    return unique;
  }

  // ---- one body ----

  void make_body(Body& body) {
    if (body.motion) {
      base::Object motion = physics_[*body.motion]->object("motion");
      const bool is_kinematic = motion.boolean_or("isKinematic", false), is_heavy = motion.has("mass") && motion.number("mass") == 0.0;
      body.is_fixed = is_kinematic || is_heavy;
      if (motion.number_or("gravityFactor", 1.0) != 1.0) warn(*body.motion, "its gravityFactor is left out: it falls as the others");
    }
    if (!body.model && body.colliders.empty()) {
      warn(*body.motion, "it has no collider and no model, hence no surface; it is left out");
      return;
    }
    body.entry = base::Json::object();
    if (body.model)
      make_sounding(body);
    else if (!make_silent(body))
      return;
    const std::size_t node = find_first_node(body);
    body.name = choose_name(node);
    if (body.is_fixed) body.entry.set("fixed", true);
    if (body.motion) read_velocity(body);
    read_contact(body);
    for (std::size_t c = 0; c < 3; ++c)
      if (!(std::abs(body.place[static_cast<int>(c)]) <= kFarthestGltfM))
        graph_.nodes[node].fail(
            "", fmt::format("it is {:.3g} m from the origin; at most {:g} m are rendered", body.place.norm(), kFarthestGltfM));
    ++made_.bodies;
  }

  void set_pose(Body& body, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& place) {
    Eigen::Matrix3d up;
    up << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    const Eigen::Quaterniond q = Eigen::Quaterniond(up * rotation).normalized();
    body.place = raise(place);
    body.entry.set("position_m", make_list(body.place));
    body.entry.set("quaternion", base::Json::array(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()}));
  }

  /// Mass, centre and inertia of the motion in the space of another node of the body.
  Placement read_placement(const Body& body, const Eigen::Matrix3d& frame, const Eigen::Vector3d& place, const Eigen::Matrix3d& rotation) {
    if (!body.motion || body.is_fixed) return {};
    base::Object motion = physics_[*body.motion]->object("motion");
    Placement placement = read_motion(motion);
    const gltf::Matrix& of = graph_.global[*body.motion];
    if (placement.centre_m) {
      const Eigen::Vector3d world = get_linear(of) * to_eigen(*placement.centre_m) + get_place(of);
      placement.centre_m = to_vec3(frame.inverse() * (world - place));
    }
    if (placement.inertia_kg_m2) {
      const Eigen::Matrix3d turn = rotation.transpose() * find_rotation(get_linear(of));
      Eigen::Map<Eigen::Matrix3d> inertia(placement.inertia_kg_m2->data());
      inertia = (turn * inertia * turn.transpose()).eval();
    }
    return placement;
  }

  /// Part of the key of a bank.
  static std::string describe_mass(const Placement& placement) {
    std::string key;
    if (placement.mass_kg) key += fmt::format(" m {:.11e}", *placement.mass_kg);
    if (const auto& c = placement.centre_m) key += fmt::format(" c {:.9e} {:.9e} {:.9e}", (*c)[0], (*c)[1], (*c)[2]);
    if (placement.inertia_kg_m2)
      for (const double x : *placement.inertia_kg_m2) key += fmt::format(" {:.9e}", x);
    return key;
  }

  static double round_scale(double scale) { return std::strtod(fmt::format("{:.11e}", scale).c_str(), nullptr); }

  void make_sounding(Body& body) {
    const std::size_t n = *body.model_node;
    const double scale = round_scale(require_scale(graph_, n));
    const Eigen::Matrix3d linear = get_linear(graph_.global[n]), rotation = find_rotation(linear);
    const Eigen::Vector3d place = get_place(graph_.global[n]);
    Placement placement = read_placement(body, linear, place, rotation);
    placement.scale = scale;
    std::string key = fmt::format("model {} {}", *body.model, scale);
    key += describe_mass(placement);
    auto found = banks_.find(key);
    if (found == banks_.end()) {
      ModelBank model = read_model(file_, *body.model, placement, *reading_);
      if (!model.reading.empty()) made_.readings.push_back(fmt::format("{}: {}", name_node(n), model.reading));
      for (const std::string& warning : model.warnings) warn(n, warning);
      base::Object& of = models_[*body.model];
      const std::string name = of.has_string("name") ? of.string_or("name", "") : "";
      found = banks_.emplace(key, put_bank(name.empty() ? fmt::format("model{}", *body.model) : name, model.bank)).first;
    }
    body.entry.set("bank", found->second.file);
    set_pose(body, rotation, place);
    const KnownBank& bank = found->second;
    compare_colliders(body, bank, linear, place, scale);
    if (audio_[n]->has("gain")) {
      const double gain = audio_[n]->number("gain");
      if (!(gain >= 0.0 && gain <= 1e6)) audio_[n]->fail("gain", fmt::format("is {:g}; give 0 to 1e6", gain));
      if (gain != 1.0) body.entry.set("gain", gain);
    }
  }

  /// The colliders of a sounding body should be like its surface, by which it collides.
  void compare_colliders(const Body& body, const KnownBank& bank, const Eigen::Matrix3d& linear, const Eigen::Vector3d& place,
                         double scale) {
    if (body.colliders.empty()) return;
    Surface surface;
    for (const std::size_t n : body.colliders) add_surface(n, linear / scale, place, surface);
    if (surface.vertices_m.empty()) return;
    const auto find_box = [](const std::vector<Vec3>& points) {
      Eigen::AlignedBox3d box;
      for (const Vec3& p : points) box.extend(to_eigen(p));
      return box;
    };
    const Eigen::AlignedBox3d own = find_box(bank.corners), of_collider = find_box(surface.vertices_m);
    const double off =
        std::max((own.min() - of_collider.min()).cwiseAbs().maxCoeff(), (own.max() - of_collider.max()).cwiseAbs().maxCoeff());
    if (off > kLikeShape * own.sizes().maxCoeff())
      warn(body.colliders.front(),
           fmt::format("its collider differs from the surface of its model by {:.3g} m; it collides by the latter", off));
  }

  bool make_silent(Body& body) {
    const std::size_t n = find_first_node(body);
    const Eigen::Matrix3d linear = get_linear(graph_.global[n]), rotation = find_rotation(linear);
    const Eigen::Vector3d place = get_place(graph_.global[n]);
    SilentBody silent;
    for (const std::size_t collider : body.colliders) add_surface(collider, rotation, place, silent.surface);
    if (silent.surface.triangles.empty()) return false;
    Placement placement;
    if (body.motion && !body.is_fixed) {
      // Centre: in metres, in the frame of the body.
      placement = read_placement(body, rotation, place, rotation);
      silent.centre_m = placement.centre_m;
      silent.inertia_kg_m2 = placement.inertia_kg_m2;
      silent.mass_kg = placement.mass_kg;
    }
    const std::optional<std::size_t> material = find_material(body);
    if (material) {
      base::Object& own = materials_[*material];
      silent.young_modulus_pa =
          read_positive(own, "youngsModulus", silent.young_modulus_pa, material::kMinStiffnessPa, material::kMaxStiffnessPa);
      silent.density_kg_m3 = read_positive(own, "density", silent.density_kg_m3, material::kMinDensityKgM3, material::kMaxDensityKgM3);
      silent.poisson_ratio = own.has("poissonRatio") ? own.number("poissonRatio", {-1.0, 0.5}) : silent.poisson_ratio;
    }
    if (body.motion && !body.is_fixed && !silent.mass_kg)
      warn(n, fmt::format("its motion has no mass; {:g} kg/m^3 are taken", silent.density_kg_m3));
    silent.origin = fmt::format("{}, node {}", file_.name(), n);
    std::string key = fmt::format("silent {} {} {}", silent.young_modulus_pa, silent.poisson_ratio, silent.density_kg_m3);
    key += describe_mass(placement);
    for (const Vec3& v : silent.surface.vertices_m) key += fmt::format(" {:.9e} {:.9e} {:.9e}", v[0] + 0.0, v[1] + 0.0, v[2] + 0.0);
    auto found = banks_.find(key);
    if (found == banks_.end()) {
      std::vector<std::string> warnings;
      try {
        const bank::Bank bank = make_silent_bank(silent, warnings);
        found = banks_.emplace(key, put_bank("silent", bank)).first;
      } catch (const InputError& error) {
        graph_.nodes[n].fail("", error.what());
      }
      for (const std::string& warning : warnings) warn(n, warning);
    }
    body.entry.set("bank", found->second.file);
    set_pose(body, rotation, place);
    // In the draft only models sound, also by their acceleration.
    body.entry.set("effects", base::Json::array());
    return true;
  }

  KnownBank put_bank(const std::string& name, const bank::Bank& bank) {
    std::string stem;
    for (const char c : name.substr(0, 60)) stem += std::isalnum(static_cast<unsigned char>(c)) ? c : '-';
    std::string file = stem + ".hdf";
    for (int k = 2; !files_.insert(file).second; ++k) file = fmt::format("{}-{}.hdf", stem, k);
    (*sink_)(file, bank);
    ++made_.banks;
    return {file, bank.vertices_m};
  }

  void read_velocity(Body& body) {
    base::Object motion = physics_[*body.motion]->object("motion");
    const Eigen::Matrix3d rotation = find_rotation(get_linear(graph_.global[*body.motion]));
    const auto read = [&](const char* key, double limit, const char* to, const char* unit) {
      const Eigen::Vector3d velocity = raise(rotation * to_eigen(Vec3(motion.numbers_or<3>(key, {0, 0, 0}))));
      if (!(velocity.cwiseAbs().maxCoeff() <= limit))
        motion.fail(key, fmt::format("is {:.4g} {}; at most {:g} are rendered", velocity.norm(), unit, limit));
      if (velocity.isZero(0.0)) return;
      if (body.is_fixed)
        warn(*body.motion, fmt::format("its {} is left out: bodies without a finite mass do not move", key));
      else
        body.entry.set(to, make_list(velocity));
    };
    read("linearVelocity", kFastMS, "velocity_m_s", "m/s");
    read("angularVelocity", kFastRadS, "angular_velocity_rad_s", "rad/s");
  }

  // ---- surfaces of colliders ----

  base::Object open_geometry(std::size_t n) {
    base::Object collider = physics_[n]->object("collider");
    return collider.object("geometry");
  }

  /// Shape of a collider in the space of its node.
  Surface read_shape(std::size_t n) {
    base::Object geometry = open_geometry(n);
    if (geometry.boolean_or("convexHull", false) && geometry.has("node")) warn(n, "its collider is the mesh itself, not its convex hull");
    return read_geometry(file_, graph_, shapes_, geometry);
  }

  /// Adds the shape of a collider, in metres in a frame.
  void add_surface(std::size_t n, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& place, Surface& to) {
    const Eigen::Matrix3d linear = get_linear(graph_.global[n]);
    if (linear.determinant() == 0.0) {
      warn(n, "its scale is 0, which switches its collider off");
      return;
    }
    Surface surface = read_shape(n);
    const Eigen::Vector3d from = get_place(graph_.global[n]) - place;
    const auto first = static_cast<std::int32_t>(to.vertices_m.size());
    for (const Vec3& v : surface.vertices_m) to.vertices_m.push_back(to_vec3(rotation.transpose() * (linear * to_eigen(v) + from)));
    for (Triangle triangle : surface.triangles) {
      if (linear.determinant() < 0.0) std::swap(triangle[1], triangle[2]);
      for (std::int32_t& v : triangle) v += first;
      to.triangles.push_back(triangle);
    }
  }

  // ---- contacts ----

  std::optional<std::size_t> find_surface(const Body& body) {
    std::vector<std::size_t> nodes = body.colliders;
    nodes.insert(nodes.begin(), find_first_node(body));
    if (body.model_node) nodes.insert(nodes.begin(), *body.model_node);
    for (const std::size_t n : nodes)
      if (audio_[n])
        if (const auto surface = gltf::find_index(*audio_[n], "acousticSurface", surfaces_.size(), "acoustic surface")) return surface;
    return std::nullopt;
  }

  std::optional<std::size_t> find_material(const Body& body) {
    const std::optional<std::size_t> surface = find_surface(body);
    return surface ? gltf::find_index(surfaces_[*surface], "material", materials_.size(), "acoustic material") : std::nullopt;
  }

  std::optional<std::size_t> find_physics_material(const Body& body) {
    for (const std::size_t n : body.colliders) {
      base::Object collider = physics_[n]->object("collider");
      if (collider.has("collisionFilter") && !has_filter_warning_) {
        warn(n, "collision filters are left out: all bodies collide");
        has_filter_warning_ = true;
      }
      if (const auto index = gltf::find_index(collider, "physicsMaterial", physics_materials_.size(), "physics material")) return index;
    }
    return std::nullopt;
  }

  double read_roughness(std::size_t surface) {
    base::Object& own = surfaces_[surface];
    const double roughness = own.number_or("roughness", kDefaultRoughnessM);
    if (!(roughness >= 0.0)) own.fail("roughness", fmt::format("is {:g} m; it must not be negative", roughness));
    return std::min(roughness, kRoughM);
  }

  void read_contact(Body& body) {
    if (const auto surface = find_surface(body)) body.entry.set("roughness_m", read_roughness(*surface));
    read_physics_material(body);
  }

  void read_physics_material(Body& body) {
    const std::optional<std::size_t> index = find_physics_material(body);
    if (!index) return;
    base::Object& material = physics_materials_[*index];
    const auto read = [&](const char* key, double fallback, const char* mode_key) {
      const double value = material.number_or(key, fallback);
      if (!(value >= 0.0)) material.fail(key, fmt::format("is {:g}; it must not be negative", value));
      return GltfContact{value, material.choice_or(mode_key, {"average", "minimum", "maximum", "multiply"}, "average")};
    };
    body.restitution = read("restitution", kDefaultRestitution, "restitutionCombine");
    body.friction = read("dynamicFriction", kDefaultFriction, "frictionCombine");
  }

  void settle(const char* key, std::optional<GltfContact> Body::*member, double limit) {
    GltfContacts contacts;
    for (const Body& body : bodies_)
      if ((body.is_in_ground || !body.entry.is_null()) && body.*member) contacts.add(*(body.*member), body.is_fixed);
    contacts.settle(key, limit, made_.warnings);
    for (Body& body : bodies_)
      if (body.*member) {
        const double value = contacts.get(*(body.*member), body.is_fixed);
        if (body.is_in_ground)
          ground_.set(key, value);
        else if (!body.entry.is_null())
          body.entry.set(key, value);
      }
  }

  // ---- ground ----

  std::optional<Slab> find_slab(std::size_t b) {
    Body& body = bodies_[b];
    if (body.model || body.motion || body.colliders.size() != 1) return std::nullopt;
    const std::size_t n = body.colliders.front();
    base::Object geometry = open_geometry(n);
    const auto index = gltf::find_index(geometry, "shape", shapes_.size(), "shape");
    if (!index || shapes_[*index].string("type") != "box") return std::nullopt;
    const Surface box = read_shape(n);
    const gltf::Matrix& matrix = graph_.global[n];
    const Eigen::Vector3d half = 2.0 * to_eigen(box.vertices_m.back());
    int upright = 0;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d side = raise(get_linear(matrix).col(k) * half[k]);
      const bool is_upright = std::hypot(side[0], side[1]) <= kLevel * std::abs(side[2]);
      if (!is_upright && !(std::abs(side[2]) <= kLevel * side.norm())) return std::nullopt;
      upright += static_cast<int>(is_upright);
    }
    if (upright != 1) return std::nullopt;
    constexpr double kFar = std::numeric_limits<double>::infinity();
    Slab slab{.body = b, .top_m = -kFar, .low = {kFar, kFar}, .high = {-kFar, -kFar}};
    for (const Vec3& v : box.vertices_m) {
      const Eigen::Vector3d corner = raise(get_linear(matrix) * to_eigen(v) + get_place(matrix));
      slab.top_m = std::max(slab.top_m, corner[2]);
      for (int k = 0; k < 2; ++k) {
        slab.low[k] = std::min(slab.low[k], corner[k]);
        slab.high[k] = std::max(slab.high[k], corner[k]);
      }
    }
    return slab;
  }

  /// The lowest level of static boxes, if it is of one kind, nothing moving is below and something is above it.
  void find_ground() {
    std::vector<Slab> slabs;
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      if (const std::optional<Slab> slab = find_slab(b)) slabs.push_back(*slab);
    if (slabs.empty()) return;
    double top = std::numeric_limits<double>::infinity();
    for (const Slab& slab : slabs) top = std::min(top, slab.top_m);
    std::erase_if(slabs, [&](const Slab& slab) { return slab.top_m > top + kLevel; });
    const auto get_kind = [&](const Slab& slab) {
      const Body& body = bodies_[slab.body];
      return std::pair(find_physics_material(body), find_surface(body));
    };
    bool is_above = false;
    for (const Slab& slab : slabs)
      if (get_kind(slab) != get_kind(slabs.front())) return;
    for (const Body& body : bodies_) {
      if (body.is_fixed || body.entry.is_null()) continue;
      if (body.place[2] < top) return;
      for (const Slab& slab : slabs)
        is_above = is_above || (body.place[0] >= slab.low[0] && body.place[0] <= slab.high[0] && body.place[1] >= slab.low[1] &&
                                body.place[1] <= slab.high[1]);
    }
    if (!is_above) return;
    ground_ = base::Json::object().set("height_m", top + 0.0);
    for (const Slab& slab : slabs) {
      bodies_[slab.body].is_in_ground = true;
      read_physics_material(bodies_[slab.body]);
    }
    Body& first = bodies_[slabs.front().body];
    if (const auto material = find_material(first)) {
      base::Object& own = materials_[*material];
      if (own.has("youngsModulus")) ground_.set("young_modulus_pa", read_positive(own, "youngsModulus", 0.0, 100.0, 1e13));
      if (own.has("poissonRatio")) ground_.set("poisson_ratio", own.number("poissonRatio", {-1.0, 0.5}));
      if (own.has("density")) ground_.set("density_kg_m3", read_positive(own, "density", 0.0, 1.0, 3e4));
    }
    if (const auto surface = find_surface(first)) ground_.set("roughness_m", read_roughness(*surface));
  }

  // ---- scene file ----

  void write_scene() {
    made_.scene = base::Json::object();
    made_.scene.set("duration_s", kSceneSeconds);
    if (!ground_.is_null()) made_.scene.set("ground", ground_);
    if (camera_) {
      const gltf::Matrix& matrix = graph_.global[*camera_];
      const Eigen::Vector3d place = raise(get_place(matrix));
      if (!(place.cwiseAbs().maxCoeff() <= kFarthestGltfM))
        graph_.nodes[*camera_].fail("camera", fmt::format("is more than {:g} m from the origin", kFarthestGltfM));
      const Eigen::Vector3d facing = raise(-get_linear(matrix).col(2));
      base::Json listener = base::Json::object().set("position_m", make_list(place));
      if (facing.norm() > 0.0) listener.set("facing", make_list(facing.normalized()));
      made_.scene.set("listener", listener);
    }
    base::Json list = base::Json::array();
    for (const Body& body : bodies_) {
      if (body.entry.is_null() || body.name.empty()) continue;
      base::Json entry = base::Json::object().set("name", body.name);
      for (const char* key : {"bank", "fixed", "position_m", "quaternion", "velocity_m_s", "angular_velocity_rad_s", "restitution",
                              "friction", "roughness_m", "gain", "effects"})
        if (body.entry.has(key)) entry.set(key, body.entry[key]);
      list.add(entry);
    }
    if (list.empty()) throw InputError(fmt::format("{}: its scene has a ground and no other body; add one", file_.name()));
    made_.scene.set("bodies", list);
  }

  gltf::File file_;
  const GlbReading* reading_;
  const Sink* sink_;
  base::Object root_;
  gltf::Graph graph_;
  std::vector<base::Object> models_, materials_, surfaces_, physics_materials_, shapes_;
  std::vector<std::optional<base::Object>> audio_, physics_;  // by node
  std::vector<Body> bodies_;
  std::map<std::string, KnownBank> banks_;  // by all that they are made of
  std::set<std::string> names_, files_;
  std::optional<std::size_t> camera_;
  bool has_filter_warning_ = false;
  base::Json ground_;
  GltfScene made_;
};

}  // namespace

GltfScene read_gltf_scene(std::string_view bytes, const std::string& name, const GlbReading& reading,
                          const std::function<void(const std::string& file, const bank::Bank& bank)>& sink) {
  return SceneReader(bytes, name, reading, sink).read();
}

}  // namespace carillon::exchange
