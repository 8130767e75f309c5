// Method: files with Carillon's extras: arrays from the extras, triangles and shapes from the extension, assembled as for a bank file
//   (bank::assemble_bank); values present in both must agree. Other programs' files: lambda = (2 pi f)^2 + d^2, shapes rounded to 16 bits,
//   mass properties by the divergence theorem if the model has none, multipoles if they are in the extension CARILLON_multipoles.
// Source: KHR_audio_rigid_bodies, draft of 2026 (K. Hiner).
// Deviations: the node's scale applies to the body, and to modes and mass given for the unscaled body (scale_rule.hpp).
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/base/used_points.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/exchange/damped.hpp"
#include "runtime/exchange/glb.hpp"
#include "runtime/exchange/glb_multipoles.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"
#include "runtime/exchange/scale_rule.hpp"
#include "runtime/exchange/solid.hpp"

namespace carillon::exchange {
namespace {

using gltf::Component;

constexpr std::size_t kMaxFields = 1000, kMaxListed = 10'000'000;
constexpr double kFreqTolerance = 1e-6;    // relative error of a frequency in float, through a sum of squares
constexpr double kStepTolerance = 0.02;    // steps of a shape: rounding of an integer stored as float
constexpr double kDecayTolerance = 1e-5;   // relative error of a decay in float against its law
constexpr double kScaleTolerance = 1e-4;   // relative difference between the axes of a node
constexpr double kDensityTolerance = 0.1;  // of mass over volume from the material, in a warning
constexpr const char* kChanged = "was changed since carillon-bank wrote it; --plain reads the extension alone";

/// Model in the extension.
struct Model {
  std::vector<double> freq_hz, decay_per_s;            // (M)
  std::vector<Vec3> positions;                         // (P)
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T)
  gltf::Numbers shapes;                                // (M, P) rows of three
};

/// The tensor of principal moments with their axes: keys of massProperties and of motion.
std::array<double, 9> read_inertia(base::Object& owner) {
  const auto diagonal = owner.numbers<3>("inertiaDiagonal");
  const auto q = owner.numbers_or<4>("inertiaOrientation", {0, 0, 0, 1});
  const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
  if (!(turn.norm() > 0.0)) owner.fail("inertiaOrientation", "is not a rotation; it must be a unit quaternion");
  const Eigen::Matrix3d axes = turn.normalized().toRotationMatrix();
  std::array<double, 9> inertia{};
  Eigen::Map<Eigen::Matrix3d>(inertia.data()) =
      axes * Eigen::Vector3d(diagonal[0], diagonal[1], diagonal[2]).asDiagonal() * axes.transpose();
  return inertia;
}

class Reader {
 public:
  Reader(gltf::File& file, const GlbReading& reading)
      : file_(file), reading_(&reading), root_(file_.root()), extension_(find_extension()) {}

  ModelBank read(std::size_t number, const Placement& placement) {
    std::vector<base::Object> models = extension_.objects("modalModels");
    base::Object& model = models[number];
    read_model(model);
    air_ = read_multipoles(file_, model, {model_.freq_hz, model_.decay_per_s, model_.positions.size()});
    std::optional<base::Object> extras = model.object_if("extras");
    std::optional<base::Object> own = extras && !reading_->ignores_extras ? extras->object_if("carillon") : std::nullopt;
    ModelBank made;
    if (own && is_as_solved(model, placement)) {
      made.bank = assemble(*own);
    } else {
      if (own) warnings_.push_back("its node changes size or mass: read as a file of another program");
      made.bank = make(model, placement);
    }
    made.reading = reading_of_scale_;
    made.warnings = std::move(warnings_);
    return made;
  }

  std::size_t choose_model() {
    std::vector<base::Object> models = extension_.objects("modalModels");
    if (models.empty()) extension_.fail("modalModels", "this file has no modal model; export it with one");
    if (!reading_->model && models.size() > 1)
      extension_.fail("modalModels", fmt::format("there are {} models; choose one with --model, from 0, or import the scene into a folder",
                                                 models.size()));
    const std::size_t number = reading_->model.value_or(0);
    if (number >= models.size())
      extension_.fail("modalModels", fmt::format("there is no model {}; there are {}, numbered from 0", number, models.size()));
    return number;
  }

 private:
  base::Object find_extension() {
    std::optional<base::Object> extensions = root_.object_if("extensions");
    if (!extensions || !extensions->has(kExtension))
      throw InputError(fmt::format("{}: it has no {}, hence no modes; compute them with carillon hear", file_.name(), kExtension));
    return extensions->object(kExtension);
  }

  /// True for a node that leaves the model's size and mass as they are.
  static bool is_as_solved(base::Object& model, const Placement& placement) {
    if (std::abs(placement.scale - 1.0) > kScaleTolerance) return false;
    std::optional<base::Object> own = model.object_if("massProperties");
    return !placement.mass_kg || (own && std::abs(*placement.mass_kg - own->number("mass", base::kPositive)) <= 1e-9 * *placement.mass_kg);
  }

  std::vector<double> read_scalars(base::Object& model, const char* key) {
    const gltf::Numbers numbers = file_.read(model, key, "SCALAR", {Component::kFloat});
    std::vector<double> values(numbers.count());
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = numbers.get(i, 0);
      if (!(std::isfinite(values[i]) && values[i] >= 0.0))
        model.fail(key, fmt::format("number {} is {}; it must be finite and not negative", i, values[i]));
    }
    return values;
  }

  std::vector<Vec3> read_rows(base::Object& owner, const char* key, double scale = 1.0) {
    const gltf::Numbers numbers = file_.read(owner, key, "VEC3", {Component::kFloat});
    std::vector<Vec3> rows(numbers.count());
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        rows[i][c] = scale * numbers.get(i, c);
        if (!std::isfinite(rows[i][c])) owner.fail(key, fmt::format("row {} has a coordinate that is not finite: {}", i, rows[i][c]));
      }
    return rows;
  }

  void read_model(base::Object& model) {
    model_.freq_hz = read_scalars(model, "frequencies");
    model_.decay_per_s = read_scalars(model, "decayRates");
    const std::size_t modes = model_.freq_hz.size();
    if (model_.decay_per_s.size() != modes)
      model.fail("decayRates", fmt::format("has {} numbers, but there are {} frequencies", model_.decay_per_s.size(), modes));
    for (std::size_t m = 0; m < modes; ++m)
      if (!(model_.freq_hz[m] > 0.0)) model.fail("frequencies", fmt::format("number {} is 0; a frequency must be above 0", m));
    model_.positions = read_rows(model, "positions");
    const std::size_t points = model_.positions.size();
    model_.shapes = file_.read(model, "shapes", "VEC3", {Component::kFloat});
    if (model_.shapes.count() / points != modes || model_.shapes.count() % points != 0)
      model.fail("shapes",
                 fmt::format("has {} rows, but {} modes at {} points need {}", model_.shapes.count(), modes, points, modes * points));
    if (!model.has("indices")) model.fail("", "the model has no \"indices\", and a bank needs a surface; export it with them");
    const gltf::Numbers corners = file_.read(model, "indices", "SCALAR", gltf::kIndexTypes);
    if (corners.count() % 3 != 0) model.fail("indices", fmt::format("{} corners are no whole number of triangles", corners.count()));
    model_.triangles.resize(corners.count() / 3);
    for (std::size_t i = 0; i < corners.count(); ++i) {
      const double v = corners.get(i, 0);
      if (!(v < static_cast<double>(points)))
        model.fail("indices", fmt::format("index {} is {}, but there are only {} points", i, v, points));
      model_.triangles[i / 3][i % 3] = static_cast<std::int32_t>(v);
    }
  }

  // ---- files written by Carillon ----

  /// Mode indices of the rows of some shapes.
  std::vector<std::size_t> read_modes(base::Object& object, std::size_t count, std::size_t modes) {
    std::vector<std::size_t> list;
    for (const double number : object.number_list("modes", kMaxListed)) {
      if (!(number >= 0.0 && number < static_cast<double>(modes) && number == std::floor(number)))
        object.fail("modes", fmt::format("{:g} is not a mode; there are {}", number, modes));
      list.push_back(static_cast<std::size_t>(number));
    }
    if (list.size() != count) object.fail("modes", fmt::format("lists {} modes, but there are shapes of {}", list.size(), count));
    return list;
  }

  static double get_double(const bank::FieldBytes& field, std::size_t i) {
    double value = 0.0;
    std::memcpy(&value, field.bytes.data() + i * sizeof value, sizeof value);
    return value;
  }

  /// Field of that name with `count` numbers of 8 bytes.
  const bank::FieldBytes& find_field(const char* name, std::size_t count) const {
    const auto found = fields_.find(name);
    if (found == fields_.end() || found->second.bytes.size() != count * sizeof(double) || found->second.field.dtype != "<f8")
      throw InputError(fmt::format("{}: its extras have no \"{}\" of {} numbers: it {}", file_.name(), name, count, kChanged));
    return found->second;
  }

  void read_fields(base::Object& own) {
    for (base::Object& entry : own.objects("fields")) {
      if (fields_.size() > kMaxFields) own.fail("fields", "there are more fields than a bank can have");
      bank::FieldBytes array;
      array.field.name = entry.string("name");
      array.field.dtype = entry.string("type");
      // An empty shape is a scalar, which Object::number_list() rejects.
      for (const std::int64_t extent : read_extents(entry)) array.field.shape.push_back(static_cast<std::uint64_t>(extent));
      if (entry.has("view")) {
        const std::string_view view = file_.read_view(entry, "view");
        array.bytes = std::as_bytes(std::span(view.data(), view.size()));
      }
      const std::string name = array.field.name;
      if (!fields_.emplace(name, array).second) entry.fail("name", fmt::format("\"{}\" occurs twice: the file {}", name, kChanged));
    }
  }

  static std::vector<std::int64_t> read_extents(base::Object& entry) {
    std::vector<std::int64_t> extents;
    if (entry.is_empty_list("shape")) return extents;
    for (const double n : entry.number_list("shape", 4)) {
      if (!(n >= 0.0 && n <= 9e15 && n == std::floor(n))) entry.fail("shape", fmt::format("{:g} is not a number of rows", n));
      extents.push_back(static_cast<std::int64_t>(n));
    }
    return extents;
  }

  /// Copies the steps of some modes' shapes into (V, m, 3).
  void read_steps(base::Object& owner, const gltf::Numbers& shapes, const std::vector<std::size_t>& modes, std::size_t mode_count,
                  std::vector<std::int16_t>& steps, std::vector<bool>& is_known) {
    const std::size_t points = model_.positions.size();
    const bank::FieldBytes& scales = find_field("modes/shape_scale", mode_count);
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const std::size_t m = modes[k];
      if (is_known[m]) owner.fail("modes", fmt::format("mode {} occurs twice: the file {}", m, kChanged));
      is_known[m] = true;
      const double scale = get_double(scales, m);
      for (std::size_t v = 0; v < points; ++v)
        for (std::size_t c = 0; c < 3; ++c) {
          const double exact = scale > 0.0 ? shapes.get(k * points + v, c) / scale : shapes.get(k * points + v, c),
                       step = std::round(exact);
          if (!(std::abs(exact - step) <= kStepTolerance && std::abs(step) <= 32767.0))
            owner.fail("shapes", fmt::format("mode {} at point {} is not a whole number of steps: the file {}", k, v, kChanged));
          steps[(v * mode_count + m) * 3 + c] = static_cast<std::int16_t>(step);
        }
    }
  }

  void compare_vertices(const bank::FieldBytes& vertices) {
    for (std::size_t v = 0; v < model_.positions.size(); ++v)
      for (std::size_t c = 0; c < 3; ++c)
        if (static_cast<double>(static_cast<float>(get_double(vertices, 3 * v + c))) != model_.positions[v][c])
          throw InputError(fmt::format("{}: point {} differs from its extras: the file {}", file_.name(), v, kChanged));
  }

  /// Frequencies and decays of the extension must equal the playing values of the bank from the extras.
  void compare_modes(const bank::Bank& bank, const std::vector<std::size_t>& modes) {
    const bank::Bank played = bank::calc_corrected(bank);
    const std::vector<std::size_t> order = bank::sort_played_modes(bank);
    std::vector<std::size_t> place(order.size());  // rank of each mode among the played ones
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = i;
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const double omega = std::sqrt(played.eigenvalue_rad2_s2[place[modes[k]]]), decay = played.decay_per_s[place[modes[k]]];
      const double hz = calc_damped_hz(omega, decay);
      if (!(std::abs(model_.freq_hz[k] - hz) <= kFreqTolerance * hz && std::abs(model_.decay_per_s[k] - decay) <= kFreqTolerance * decay))
        throw InputError(fmt::format("{}: mode {} has {:.7g} Hz, but {:.7g} Hz in its extras: the file {}", file_.name(), k,
                                     model_.freq_hz[k], hz, kChanged));
    }
  }

  bank::Bank assemble(base::Object& own) {
    read_fields(own);
    const auto eigenvalues = fields_.find("modes/eigenvalue"), shape = fields_.find("modes/shape");
    if (eigenvalues == fields_.end() || shape == fields_.end() || shape->second.field.shape.size() != 3)
      own.fail("fields", fmt::format("eigenvalues or shapes are missing: the file {}", kChanged));
    const std::size_t mode_count = eigenvalues->second.bytes.size() / sizeof(double), points = model_.positions.size();
    compare_vertices(find_field("mesh/vertices", 3 * points));
    std::optional<base::Object> still = own.object_if("still");
    gltf::Numbers still_shapes;
    if (still) still_shapes = file_.read(*still, "shapes", "VEC3", {Component::kFloat});
    const std::size_t still_count = still_shapes.count() / points;
    if (still_shapes.count() % points != 0 || model_.freq_hz.size() + still_count != mode_count)
      own.fail("modes", fmt::format("there are shapes of {} modes, but {} modes: the file {}", model_.freq_hz.size() + still_count,
                                    mode_count, kChanged));
    std::vector<std::int16_t> steps(3 * mode_count * points);
    std::vector<bool> is_known(mode_count, false);
    const std::vector<std::size_t> swinging = read_modes(own, model_.freq_hz.size(), mode_count);
    read_steps(own, model_.shapes, swinging, mode_count, steps, is_known);
    if (still) read_steps(*still, still_shapes, read_modes(*still, still_count, mode_count), mode_count, steps, is_known);

    std::vector<std::int8_t> narrow;
    if (shape->second.field.dtype == "|i1") {
      narrow.assign(steps.begin(), steps.end());
      shape->second.bytes = std::as_bytes(std::span(narrow));
    } else {
      shape->second.bytes = std::as_bytes(std::span(steps));
    }
    std::vector<bank::FieldBytes> arrays;
    for (const auto& [name, array] : fields_) arrays.push_back(array);
    bank::FieldBytes triangles;
    triangles.field = {"mesh/triangles", "<i4", {model_.triangles.size(), 3}, "", "", nullptr};
    triangles.bytes = std::as_bytes(std::span(model_.triangles));
    arrays.push_back(triangles);
    bank::Bank bank = bank::assemble_bank(arrays, file_.name());
    for (const bank::Check& check : {bank::calc_regions_check(bank), bank::calc_provenance_check(bank)})
      if (!check.faults.empty()) throw InputError(fmt::format("{}: {}: the file {}", file_.name(), check.faults[0], kChanged));
    compare_modes(bank, swinging);
    if (air_ && !are_multipoles_of(*air_, bank.multipoles, swinging))
      throw InputError(fmt::format("{}: {} differs from its extras: the file {}", file_.name(), kMultipoles, kChanged));
    return bank;
  }

  // ---- files of other programs ----

  /// Joins points at one place, and removes those without triangles.
  void drop_unused_points() {
    std::map<Vec3, std::int32_t> first;
    for (std::array<std::int32_t, 3>& triangle : model_.triangles)
      for (std::int32_t& v : triangle) v = first.try_emplace(model_.positions[v], v).first->second;
    base::UsedPoints used = base::find_used_points(model_.triangles, model_.positions.size());
    used_ = std::move(used.points);
    for (auto& triangle : model_.triangles)
      for (std::int32_t& v : triangle) v = used.number[v];
    if (const std::size_t dropped = used.number.size() - used_.size(); dropped > 0)
      warnings_.push_back(fmt::format("{} of its points belong to no triangle, or repeat another one, and were dropped", dropped));
  }

  bank::Material read_material(base::Object& model) {
    bank::Material material;
    if (reading_->material != nullptr) {
      material.young_modulus_pa = reading_->material->young_modulus_pa;
      material.poisson_ratio = reading_->material->poisson_ratio;
      material.density_kg_m3 = reading_->material->density_kg_m3;
      return material;
    }
    std::vector<base::Object> materials = extension_.objects("acousticMaterials");
    const auto number = model.integer_if("material", 0, static_cast<long long>(materials.size()) - 1);
    if (!number) model.fail("material", "the model names no material, and contacts need its stiffness; give --material NAME");
    base::Object& own = materials[*number];
    for (const char* key : {"density", "youngsModulus", "poissonRatio"})
      if (!own.has(key)) own.fail(key, fmt::format("the material of the model has no \"{}\"; give --material NAME", key));
    material.density_kg_m3 = own.number("density", base::kPositive);
    material.young_modulus_pa = own.number("youngsModulus", base::kPositive);
    material.poisson_ratio = own.number("poissonRatio", {-1.0, 0.5});
    material.alpha2_per_s = own.number_or("alpha", 0.0);
    material.alpha1_s = own.number_or("beta", 0.0);
    return material;
  }

  /// Mass, centre and inertia of the body. `solid`: of its surface; `factor`: of lengths of the model that are not positions.
  void read_mass(base::Object& model, const Placement& placement, const Solid& solid, double factor, bank::Bank& bank) {
    bank::RigidBody& rigid = bank.rigid;
    std::optional<base::Object> own = model.object_if("massProperties");
    const double cube = std::pow(factor, 3);
    const double model_kg = own ? cube * own->number("mass", base::kPositive) : bank.material.density_kg_m3 * solid.volume_m3;
    rigid.mass_kg = placement.mass_kg.value_or(model_kg);
    std::optional<Vec3> centre = placement.centre_m;
    if (!centre && own) centre = own->numbers_or<3>("centerOfMass", {0, 0, 0});
    if (centre) centre = placement.scale * *centre;
    std::optional<std::array<double, 9>> inertia = placement.inertia_kg_m2;
    if (!inertia && own && own->has("inertiaDiagonal")) {
      inertia = read_inertia(*own);
      for (double& x : *inertia) x *= cube * factor * factor * rigid.mass_kg / model_kg;
    }
    settle_rigid(centre, inertia, solid, bank, warnings_);
    const double density = rigid.mass_kg / solid.volume_m3;
    if (std::abs(density / bank.material.density_kg_m3 - 1.0) > kDensityTolerance)
      warnings_.push_back(fmt::format("its mass over its volume is {:.5g} kg/m^3, and the density of its material {:.5g}: the mass is kept",
                                      density, bank.material.density_kg_m3));
    bank.material.density_kg_m3 = density;
  }

  /// Multipoles of the modes in the order `order`, of which the decays lose what radiation adds. `size`: of the body relative to the
  /// multipoles' at the same frequencies; `factor`: of all lengths of the model; `turn`: factor of the shapes.
  void take_multipoles(const std::vector<std::size_t>& order, double size, double factor, double turn, bank::Bank& bank) const {
    bank::Multipoles& air = bank.multipoles = bank::select_multipoles(air_->multipoles, order);
    for (std::size_t m = 0; m < order.size(); ++m) bank.decay_per_s[m] = std::max(0.0, bank.decay_per_s[m] - air.decay_per_s[m]);
    air.centre_m = size * air.centre_m;
    air.radius_m *= size;
    air.nearest_m *= size;
    bank::scale_size(air, factor);
    const double other_mass = turn * std::sqrt(std::pow(factor, 3));  // shapes of another mass than that of the model
    for (double& x : air.scale) x *= other_mass;
    for (double& x : air.decay_per_s) x *= other_mass * other_mass;
  }

  /// Modes of a body `factor` times as large.
  static void scale_modes(bank::Bank& bank, double factor) {
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      bank.eigenvalue_rad2_s2[m] /= factor * factor;
      bank.decay_per_s[m] = bank.damping.law == "mixed" ? bank.decay_per_s[m] / factor  // equal loss factor
                                                        : bank::calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2[m]);
    }
  }

  /// Rayleigh's law if the decays follow it, else "mixed".
  static void settle_damping(bank::Bank& bank) {
    bank.damping.law = "mixed";
    const double a1 = bank.material.alpha1_s, a2 = bank.material.alpha2_per_s;
    std::vector<double> law;
    for (std::size_t m = 0; m < bank.mode_count(); ++m) law.push_back(0.5 * (a1 * bank.eigenvalue_rad2_s2[m] + a2));
    for (std::size_t m = 0; m < bank.mode_count(); ++m)
      if (!(std::abs(bank.decay_per_s[m] - law[m]) <= kDecayTolerance * law[m])) {
        bank.material.alpha1_s = bank.material.alpha2_per_s = 0.0;
        return;
      }
    bank.damping.law = "rayleigh";
    bank.decay_per_s = law;
  }

  bank::Bank make(base::Object& model, const Placement& placement) {
    drop_unused_points();
    const std::size_t modes = model_.freq_hz.size(), points = used_.size();
    bank::Bank bank;
    for (const std::int32_t v : used_) bank.vertices_m.push_back(model_.positions[v]);
    bank.triangles = model_.triangles;
    bank.material = read_material(model);
    const double stored_m3 = calc_solid(bank.vertices_m, bank.triangles).volume_m3;
    if (!(stored_m3 > 0.0))
      model.fail("indices", "its triangles enclose no volume or face inward; a bank needs a closed surface that faces outward");
    std::optional<base::Object> own = model.object_if("massProperties");
    const std::optional<double> model_kg = own ? std::optional(own->number("mass", base::kPositive)) : std::nullopt;
    const std::optional<double> density = reading_->material == nullptr ? std::optional(bank.material.density_kg_m3) : std::nullopt;
    const ScaleChoice choice = choose_scale({.scale = placement.scale,
                                             .model_kg = model_kg,
                                             .body_kg = placement.mass_kg,
                                             .density_kg_m3 = density,
                                             .volume_m3 = stored_m3,
                                             .lowest_hz = *std::min_element(model_.freq_hz.begin(), model_.freq_hz.end()),
                                             .is_unscaled = reading_->scales_frequencies});
    (choice.is_sure ? reading_of_scale_ : warnings_.emplace_back()) = choice.reason;
    const double factor = choice.is_unscaled ? placement.scale : 1.0;
    for (Vec3& p : bank.vertices_m) p = placement.scale * p;

    std::vector<double> lambda(modes);
    for (std::size_t m = 0; m < modes; ++m)
      lambda[m] = std::pow(2.0 * std::numbers::pi * model_.freq_hz[m], 2) + model_.decay_per_s[m] * model_.decay_per_s[m];
    const std::vector<std::size_t> order = base::find_sort_order(lambda);
    // Mass-normalised for the mass of the model; the body may have another one.
    const double cube = std::pow(factor, 3);
    const double mass_ratio = model_kg && placement.mass_kg ? *model_kg / *placement.mass_kg : 1.0 / cube;
    const double turn = std::sqrt(mass_ratio);
    std::vector<double> shapes(3 * modes * points);
    const gltf::Numbers& rows = air_ && air_->shapes ? *air_->shapes : model_.shapes;
    for (std::size_t m = 0; m < modes; ++m) {
      bank.eigenvalue_rad2_s2.push_back(lambda[order[m]]);
      bank.decay_per_s.push_back(model_.decay_per_s[order[m]]);
      for (std::size_t v = 0; v < points; ++v)
        for (std::size_t c = 0; c < 3; ++c) {
          const double phi = rows.get(order[m] * model_.positions.size() + static_cast<std::size_t>(used_[v]), c);
          if (!std::isfinite(phi)) model.fail("shapes", fmt::format("mode {} moves point {} by {}", order[m], v, phi));
          shapes[(v * modes + m) * 3 + c] = turn * phi;
        }
    }
    if (air_) take_multipoles(order, placement.scale / factor, factor, turn, bank);
    settle_damping(bank);
    if (choice.is_unscaled) scale_modes(bank, factor);
    read_mass(model, placement, calc_solid(bank.vertices_m, bank.triangles), factor, bank);
    bank.residual.assign(modes, 0.0);
    bank::quantise_shapes(bank, shapes);
    bank::set_radiation_gains(bank, shapes);
    bank.counts = {.nodes = static_cast<std::int64_t>(points), .tets = 1, .components = 1, .rigid_modes = 6};
    bank.band_hz = {std::min(20.0, 0.99 * bank.freq_hz(0)), std::max(20000.0, 1.01 * bank.freq_hz(modes - 1))};
    bank.complete = false;
    bank.element = "imported";
    bank.mass = "consistent";
    bank.provenance = base::Json::object()
                          .set("imported", kExtension)
                          .set("file", base::printable(file_.name()))
                          .set("notes", base::Json::array(list_notes()))
                          .line();
    if (const std::vector<std::string> faults = bank::find_faults(bank); !faults.empty())
      model.fail("", fmt::format("is not a valid bank: {}; correct it in the program that made it", faults[0]));
    return bank;
  }

  std::vector<std::string> list_notes() const {
    std::vector<std::string> notes = warnings_;
    if (!reading_of_scale_.empty()) notes.insert(notes.begin(), reading_of_scale_);
    return notes;
  }

  gltf::File& file_;
  const GlbReading* reading_;
  base::Object root_, extension_;
  Model model_;
  std::optional<GlbMultipoles> air_;
  std::vector<std::int32_t> used_;  // used points of another program's model
  std::string reading_of_scale_;
  std::vector<std::string> warnings_;
  std::map<std::string, bank::FieldBytes> fields_;
};

/// The first node with the model.
Placement find_placement(base::Object root, std::size_t number) {
  gltf::Graph graph = gltf::read_graph(root);
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    std::optional<base::Object> extensions = graph.nodes[n].object_if("extensions");
    std::optional<base::Object> own = extensions ? extensions->object_if(kExtension) : std::nullopt;
    if (!own || own->integer_if("modalModel", 0, std::numeric_limits<std::int32_t>::max()) != static_cast<long long>(number)) continue;
    std::optional<base::Object> physics = extensions->object_if(kPhysicsExtension);
    std::optional<base::Object> motion = physics ? physics->object_if("motion") : std::nullopt;
    Placement placement = motion ? read_motion(*motion) : Placement{};
    placement.scale = require_scale(graph, n);
    return placement;
  }
  return {};
}

}  // namespace

ModelBank read_model(gltf::File& file, std::size_t number, const Placement& placement, const GlbReading& reading) {
  return Reader(file, reading).read(number, placement);
}

double require_scale(gltf::Graph& graph, std::size_t node) {
  const std::optional<double> scale = gltf::find_scale(graph.global[node]);
  if (!scale)
    graph.nodes[node].fail("",
                           "is mirrored, or not scaled by the same along all axes, which changes the modes; apply the scale, and compute "
                           "them again");
  return *scale;
}

Placement read_motion(base::Object& motion) {
  Placement placement;
  if (motion.has("mass")) {
    const double mass = motion.number("mass");
    if (!(mass >= 0.0)) motion.fail("mass", fmt::format("is {:g} kg; it must not be negative", mass));
    if (mass > 0.0) placement.mass_kg = mass;
  }
  if (motion.has("centerOfMass")) placement.centre_m = motion.numbers<3>("centerOfMass");
  if (motion.has("inertiaDiagonal")) placement.inertia_kg_m2 = read_inertia(motion);
  return placement;
}

bank::Bank parse_glb(std::string_view bytes, const std::string& name, const GlbReading& reading, std::vector<std::string>* notes) {
  gltf::File file = gltf::parse(bytes, name);
  Reader reader(file, reading);
  const std::size_t number = reader.choose_model();
  ModelBank made = reader.read(number, find_placement(file.root(), number));
  if (notes != nullptr) {
    *notes = std::move(made.warnings);
    if (!made.reading.empty()) notes->insert(notes->begin(), made.reading);
  }
  return std::move(made.bank);
}

}  // namespace carillon::exchange
