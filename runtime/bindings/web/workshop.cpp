// Method: scenes, blows and plans use scene::parse_scene, scene::make_strikes and scene::make_plan, as carillon-render does. A body's bank
// is the edited file after scene::read_banks. Blows meet a body at rest, since its ringing state is in the engine. Plans cover past events.
#include "runtime/bindings/web/workshop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/bindings/web/event_words.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/material/table.hpp"
#include "runtime/scene/effects/table.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/pose.hpp"
#include "runtime/scene/recorded_bodies.hpp"
#include "runtime/scene/session.hpp"
#include "runtime/scene/strikes.hpp"
#include "runtime/synth/effects.hpp"

namespace carillon::web {
namespace {

using base::Json;

constexpr base::Range kScale{0.0, std::numeric_limits<double>::infinity()};
constexpr double kHardestPing = 1.0;  // N s
constexpr std::size_t kMostCuts = 10000;
constexpr std::size_t kMostEvents = std::size_t{1} << 30;  // bytes of a plan's events

Json to_json(const Vec3& x) { return Json::array(x); }

/// Modes of a bank for playback, as JSON; unknown `error_cents` and `radiation_per_s` are null. `heard`: of mounting::mount().
Json list_modes(const bank::Bank& bank, const std::vector<bank::HeardMode>& heard) {
  Json modes = Json::array();
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const bank::HeardMode& mode = heard[m];
    const double cents = m < bank.discretisation_error_cents.size() ? bank.discretisation_error_cents[m] : NAN;
    Json json = Json::object();
    json.set("freq_hz", base::significant(mode.freq_hz, 9)).set("decay_per_s", base::significant(bank.decay_per_s[m], 9));
    json.set("t60_s", base::finite_or_null(mode.calc_t60_s(), base::significant, 6));
    json.set("material_per_s", base::significant(mode.material_per_s, 6));
    json.set("radiation_per_s", base::finite_or_null(bank.multipoles.is_empty() ? NAN : mode.radiation_per_s, base::significant, 6));
    json.set("supports_per_s", base::significant(mode.supports_per_s, 6)).set("gain", base::significant(bank.radiation_gain[m], 9));
    json.set("error_cents", base::finite_or_null(cents, base::significant, 4));
    if (m < bank.facet_error_cents.size()) json.set("facet_cents", base::finite_or_null(bank.facet_error_cents[m], base::significant, 4));
    modes.add(json);
  }
  return modes;
}

/// A damping law with all losses times `scale`; Rayleigh constants come from the edits or the material.
void scale_damping(double scale, const bank::Bank& bank, bank::Edits& edits) {
  if (scale == 1.0) return;
  if (!edits.damping && !edits.alphas) {
    if (bank.damping.law == "rayleigh")
      edits.alphas = {bank.material.alpha1_s, bank.material.alpha2_per_s};
    else
      edits.damping = bank.damping;
  }
  if (edits.alphas)
    for (double& alpha : *edits.alphas) alpha *= scale;
  if (!edits.damping) return;
  for (double& coefficient : edits.damping->coefficient) coefficient *= scale;
  for (double& loss : edits.damping->loss_factor) loss *= scale;
}

/// Empty: the unmodified bank.
std::optional<bank::Edits> read_edits(const bank::Bank& bank, std::string_view text) {
  const base::Document document = base::parse_document(text, "edit");
  base::Object object = document.root();
  bank::Edits edits;
  bool changes = false;
  if (object.has("material")) {
    const std::string name = object.string("material");
    edits = bank::make_edits(bank, material::MaterialTable::get().require("edit", name).material);
    changes = true;
  }
  const auto scale = [&](const char* key) {
    const double given = object.number_or(key, 1.0, kScale);
    changes = changes || given != 1.0;
    return given;
  };
  edits.density_scale *= scale("density_scale");
  edits.stiffness_scale *= scale("stiffness_scale");
  edits.size_scale *= scale("size_scale");
  const double damping_scale = scale("damping_scale");
  if (object.has("alphas") && object.has("loss")) object.fail("loss", "a body has one damping law; give \"alphas\" or \"loss\", not both");
  if (object.has("alphas")) {
    edits.alphas = object.numbers<2>("alphas");
    edits.damping.reset();
    changes = true;
  }
  if (object.has("loss")) {
    edits.damping.emplace();
    edits.damping->law = "internal_friction";
    edits.damping->coefficient = {object.number("loss", {-1e-300, 2.0})};
    edits.alphas.reset();
    changes = true;
  }
  if (object.has("cuts"))
    for (const std::vector<double>& row : object.number_rows("cuts", 5, kMostCuts)) {
      edits.cuts.push_back({{row[0], row[1], row[2]}, row[3], row[4]});
      changes = true;
    }
  object.finish();
  scale_damping(damping_scale, bank, edits);
  return changes ? std::optional(edits) : std::nullopt;
}

/// Change of the modes with sensitivities by the cuts of an edit.
std::vector<double> calc_cut_cents(const bank::Bank& before, const bank::Bank& edited, const bank::Edits& edits) {
  const double uncut = edits.stiffness_scale / (edits.density_scale * edits.size_scale * edits.size_scale);
  std::vector<double> cents;
  for (std::size_t m = 0; m < before.sensitivities.count; ++m)
    cents.push_back(600.0 * std::log2(edited.eigenvalue_rad2_s2[m] / (uncut * before.eigenvalue_rad2_s2[m])));
  return cents;
}

scene::Scene read_scene(std::string_view text, std::size_t bodies) {
  scene::Scene scene = scene::parse_scene(base::parse_document(text, "scene"));
  if (!scene.surfaces.empty())
    throw InputError(fmt::format("{}: body \"{}\" is a recording, which pages cannot play; play it with carillon-render",
                                 scene.surfaces[0].place, scene.surfaces[0].name));
  if (scene.bodies.size() != bodies)
    throw InputError(fmt::format("scene: describes {} bodies, but {} are expected", scene.bodies.size(), bodies));
  return scene;
}

std::uint32_t to_mask(synth::EffectSet effects) {
  std::uint32_t mask = 0;
  for (const synth::Effect effect : effects) mask |= 1U << static_cast<unsigned>(effect);
  return mask;
}

void check_place(const bank::Bank& bank, std::int32_t triangle) {
  if (triangle < 0 || triangle >= std::ssize(bank.triangles))
    throw InputError(fmt::format("there is no triangle {}; the surface has {}", triangle, bank.triangles.size()));
}

/// Outward, not of unit length; degenerate triangles included.
Vec3 find_normal(const bank::Bank& bank, std::int32_t triangle) {
  const Vec3 across = bank::calc_normal(bank.vertices_m, bank.triangles[triangle]);
  return (1.0 / std::max(norm(across), 1e-300)) * across;
}

/// Contact radius under 1 N for each mallet head; it grows with the cube root of the force (Hertz).
Json list_patches(const bank::Bank& bank) {
  Json patches = Json::object();
  const bank::Material& body = bank.material;
  for (const material::NamedMallet& mallet : material::get_mallets()) {
    double radius_m = mallet.radius_m, modulus_pa = 1e7;  // felt: modulus of dense felt
    if (mallet.radius_m > 0.0) {
      const material::Material& head = material::MaterialTable::get().require("mallet", mallet.material).material;
      modulus_pa = head.young_modulus_pa / (1.0 - head.poisson_ratio * head.poisson_ratio);
    } else {
      radius_m = 0.01;
    }
    const double own_pa = body.young_modulus_pa / (1.0 - body.poisson_ratio * body.poisson_ratio);
    const double pair_pa = own_pa > 0.0 ? 1.0 / (1.0 / own_pa + 1.0 / modulus_pa) : modulus_pa;
    patches.set(mallet.name, base::significant(std::cbrt(0.75 * radius_m / pair_pa), 6));
  }
  return patches;
}

}  // namespace

Workshop::Workshop(double rate_hz) : rate_hz_(rate_hz) {
  if (!(rate_hz >= 8000.0 && rate_hz <= 192000.0))
    throw InputError(fmt::format("the sample rate is {:g} Hz; give 8000 to 192000 Hz", rate_hz));
}

std::string Workshop::list_choices() const {
  Json choices = Json::object();
  for (const material::NamedMallet& mallet : material::get_mallets()) {
    choices["mallets"].add(Json::object()
                               .set("name", mallet.name)
                               .set("mass_kg", mallet.mass_kg)
                               .set("speed_m_s", material::kMalletSpeedMs)
                               .set("is_soft", mallet.radius_m == 0.0)
                               .set("restitution", mallet.restitution));
  }
  for (const material::Row& row : material::MaterialTable::get().rows()) {
    if (row.material.orthotropic) continue;  // edits keep materials isotropic
    choices["materials"].add(Json::object()
                                 .set("name", row.material.name)
                                 .set("group", row.group)
                                 .set("density_kg_m3", row.material.density_kg_m3)
                                 .set("young_modulus_pa", row.material.young_modulus_pa)
                                 .set("damping", row.material.describe_damping()));
  }
  for (const synth::Effect effect : synth::EffectSet::all()) choices["effects"].add(synth::get_name(effect));
  return choices.line();
}

const std::shared_ptr<const bank::Bank>& Workshop::find_bank(int bank) const {
  const auto found = banks_.find(bank);
  if (found == banks_.end()) throw InputError(fmt::format("there is no bank {}", bank));
  return found->second;
}

const MadeBody& Workshop::get_body(int body) const {
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) throw InputError(fmt::format("there is no body {}", body));
  return found->second;
}

std::string Workshop::add_bank(int bank, std::span<const std::byte> bytes, const std::string& name) {
  auto read = std::make_shared<bank::Bank>(bank::parse_bank(bytes, name));
  const bank::Bank& b = *read;
  Json facts = Json::object();
  facts.set("name", name).set("mode_count", static_cast<std::int64_t>(b.mode_count()));
  facts.set("vertex_count", static_cast<std::int64_t>(b.vertex_count()));
  facts.set("triangle_count", static_cast<std::int64_t>(b.triangles.size())).set("bytes", static_cast<std::int64_t>(bytes.size()));
  facts.set("mass_kg", b.rigid.mass_kg).set("volume_m3", b.rigid.volume_m3).set("centre_m", to_json(b.rigid.centre_m));
  facts.set("sensitive_modes", static_cast<std::int64_t>(b.sensitivities.count));
  facts.set("band_hz", Json::array(b.band_hz)).set("element", b.element).set("complete", b.complete);
  facts.set("completeness", bank::describe_completeness(b)).set("accuracy", bank::describe_accuracy(b));
  facts["material"].set("young_modulus_pa", b.material.young_modulus_pa).set("poisson_ratio", b.material.poisson_ratio);
  facts["material"].set("density_kg_m3", b.material.density_kg_m3).set("damping_law", b.damping.law);
  bank::Bank played = bank::choose_frequencies(b, bank::Frequencies::kCorrected);
  const std::vector<bank::HeardMode> heard = mounting::mount(played);
  facts.set("modes", list_modes(played, heard));
  banks_[bank] = std::move(read);
  return facts.line();
}

std::vector<float> Workshop::calc_shape(int bank, int mode) const {
  const bank::Bank& b = *find_bank(bank);
  if (mode < 0 || static_cast<std::size_t>(mode) >= b.mode_count())
    throw InputError(fmt::format("there is no mode {}; the bank has {}", mode, b.mode_count()));
  std::vector<float> shape;
  shape.reserve(3 * b.vertex_count());
  for (std::size_t v = 0; v < b.vertex_count(); ++v)
    for (const double x : b.shape_at(v, mode)) shape.push_back(static_cast<float>(x));
  return shape;
}

std::vector<float> Workshop::calc_density(int bank, int mode) const {
  const bank::Bank& b = *find_bank(bank);
  if (b.sensitivities.is_empty()) return {};
  if (mode < 0 || static_cast<std::size_t>(mode) >= b.sensitivities.count)
    throw InputError(fmt::format("mode {} has no sensitivities; the lowest {} modes have", mode, b.sensitivities.count));
  return bank::calc_corner_density(b, static_cast<std::size_t>(mode));
}

std::string Workshop::make_body(int body, int bank, std::string_view scene, std::string_view edits) {
  const std::shared_ptr<const bank::Bank>& as_read = find_bank(bank);
  MadeBody made{.bank = bank, .scene = read_scene(scene, 1), .played = nullptr, .model = nullptr};
  scene::SceneBody& described = made.scene.bodies[0];
  Json modes;
  std::vector<double> cut_cents;  // of the modes with sensitivities
  try {
    // As in scene::read_banks, for an edited bank.
    const std::optional<bank::Edits> wanted = read_edits(*as_read, edits);
    const bank::Bank edited = wanted ? bank::calc_edited(*as_read, *wanted) : *as_read;
    auto played = std::make_shared<bank::Bank>(bank::choose_frequencies(edited, made.scene.frequencies));
    if (wanted && !wanted->cuts.empty()) cut_cents = calc_cut_cents(*as_read, edited, *wanted);
    const std::vector<bank::HeardMode> heard = mounting::mount(*played, described.support);
    const radiation::PutGains put = radiation::put_gains(*played, made.scene.radiation);
    described.sphere_radius_m = put.sphere_radius_m;
    described.limited = put.limited;
    double radius_m = put.sphere_radius_m;
    if (radius_m == 0.0 && made.scene.radiation == radiation::GainKind::kOsg02) radius_m = radiation::calc_sphere_radius_m(*played);
    modes = list_modes(*played, heard);
    played->multipoles = {};  // no directivity in pages
    // Bodies of one bank share its surface.
    const auto own = bodies_.find(body);
    const synth::Model* like = own != bodies_.end() ? own->second.model.get() : nullptr;
    for (const auto& [number, other] : bodies_)
      if (like == nullptr && other.bank == bank) like = other.model.get();
    made.model = synth::Model::make(*played, {.rate_hz = rate_hz_, .sphere_radius_m = radius_m, .like = like});
    made.played = std::move(played);
  } catch (const InputError& error) {
    throw InputError(fmt::format("the bank of body \"{}\": {}", described.name, error.what()));
  }
  described.spec.bank = made.played.get();
  const bank::Bank& b = *made.played;
  const synth::ContactSurface surface = scene::make_surface(described);
  Json facts = Json::object();
  facts.set("name", described.name).set("fixed", described.spec.fixed);
  facts.set("position_m", to_json(scene::calc_world_point(described.spec.initial, b.rigid.centre_m)));
  facts.set("rotation", Json::array(described.spec.initial.rotation)).set("centre_m", to_json(b.rigid.centre_m));
  facts.set("mass_kg", b.rigid.mass_kg).set("modes", std::move(modes)).set("sounding_modes", made.model->get_mode_count());
  facts.set("cut_cents", Json::array(cut_cents)).set("limited_modes", static_cast<std::int64_t>(described.limited.modes));
  facts.set("silence_pa", made.scene.quality.silence_pa.value_or(synth::BodySettings{}.silence_pa)).set("roughness_m", surface.roughness_m);
  facts.set("friction", surface.friction).set("seed_high", static_cast<std::int64_t>(surface.seed >> 32));
  facts.set("seed_low", static_cast<std::int64_t>(surface.seed & 0xffffffffU)).set("patch_m", list_patches(b));
  std::swap(bodies_[body], made);
  try {
    facts.set("effects", to_mask(find_possible(body)));
  } catch (...) {
    std::swap(bodies_[body], made);
    if (made.model != nullptr && bodies_[body].model == nullptr) bodies_.erase(body);
    throw;
  }
  return facts.line();
}

namespace {

/// Models read from tables have neither transfers nor nonlinear energy; pages have neither reflecting floors nor heads.
constexpr synth::EffectSet kNotInPages{synth::Effect::kDirectivity, synth::Effect::kGroundReflection, synth::Effect::kHead,
                                       synth::Effect::kNonlinear, synth::Effect::kCascade};

/// Scene facts with the banks that the bodies play.
effects::SceneFacts make_scene_facts(const scene::Scene& scene) {
  const auto moves = [](const scene::SceneBody& body) { return !body.spec.fixed; };
  const bool any_moves = std::any_of(scene.bodies.begin(), scene.bodies.end(), moves);
  effects::SceneFacts facts = scene::make_facts(scene, scene::make_microphones(scene), any_moves);
  for (effects::BodyFacts& body : facts.bodies) {
    body.overrides.on = body.overrides.on.without(kNotInPages);
    body.overrides.off = body.overrides.off.with(kNotInPages);
  }
  return facts;
}

}  // namespace

synth::EffectSet Workshop::find_possible(int body) const {
  scene::Scene scene = get_body(body).scene;
  const effects::EffectSelector selector(make_scene_facts(scene));
  // A page's listener moves and bodies are touched, even if the scene has neither.
  synth::EffectSet possible = selector.get_possible(0);
  const effects::EffectOverrides& overrides = scene.bodies[0].overrides;
  if (overrides.automatic) {
    for (const synth::Effect effect : synth::kDefaultEffects.with(synth::kContactEffects))
      if (!overrides.off.has(effect)) possible = possible.with(effect);
  }
  return scene::find_effects(scene, 0, possible.without(kNotInPages));
}

std::string Workshop::make_blow(int body, std::string_view scene, std::int32_t triangle, const Vec3& barycentric,
                                std::optional<double> time_s, int number, std::vector<double>& words) const {
  const MadeBody& made = get_body(body);
  scene::Scene described = read_scene(scene, 1);
  if (described.strikes.size() != 1) throw InputError("scene: give exactly one strike for a blow");
  check_place(*made.played, triangle);
  described.bodies[0].spec.bank = made.played.get();
  scene::SceneStrike& strike = described.strikes[0];
  strike.triangle.reset();
  strike.point_m = bank::calc_point(*made.played, triangle, barycentric);
  scene::Strikes strikes = scene::make_strikes(described, {made.played.get()});
  const double begin_s = strike.time_s;
  for (events::Event event : strikes.events) {
    std::visit([&](auto& one) { one.time_s = one.time_s - begin_s + time_s.value_or(0.0); }, event);
    if (auto* impulse = std::get_if<events::Impulse>(&event)) impulse->body = number;
    if (auto* force = std::get_if<events::Force>(&event)) force->body = number;
    append_words(words, event, time_s ? Timing::kExact : Timing::kSoon);
  }
  Json result = Json::object();
  if (!strikes.blows.empty()) {
    const scene::Blow& blow = strikes.blows.front();
    result.set("contact_s", blow.contact_s).set("impulse_n_s", blow.impulse_n_s).set("peak_n", blow.peak_n);
    result.set("restitution", base::finite_or_null(blow.restitution, base::significant, 6)).set("before_j", blow.before_j);
    result.set("after_j", blow.after_j).set("motion_j", blow.motion_j).set("modes_j", blow.modes_j).set("lost_j", blow.lost_j);
  }
  result.set("warnings", Json::array(strikes.warnings));
  return result.line();
}

void Workshop::make_ping(int body, int mode, double pressure_pa, int number, std::vector<double>& words) const {
  const bank::Bank& b = *get_body(body).played;
  if (mode < 0 || static_cast<std::size_t>(mode) >= b.mode_count())
    throw InputError(fmt::format("there is no mode {}; the body has {}", mode, b.mode_count()));
  if (!(pressure_pa >= 0.0) || !std::isfinite(pressure_pa)) throw InputError("the pressure must be 0 Pa or more");
  events::Impulse impulse{.body = number};
  double largest = 0.0;
  Vec3 shape{};
  for (std::size_t t = 0; t < b.triangles.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3 here = b.shape_at(b.triangles[t][c], mode);
      if (!(norm(here) > largest)) continue;
      largest = norm(here);
      shape = here;
      impulse.triangle = static_cast<std::int32_t>(t);
      impulse.barycentric = {};
      impulse.barycentric[c] = 1.0;
    }
  }
  const double per_n_s = std::abs(b.radiation_gain[mode]) * largest;
  if (!(per_n_s > 0.0)) return;  // inaudible
  impulse.impulse_n_s = (std::min(pressure_pa / per_n_s, kHardestPing) / largest) * shape;
  append_words(words, impulse, Timing::kSoon);
}

std::vector<float> Workshop::calc_levels(int body, std::int32_t triangle, const Vec3& barycentric) const {
  const bank::Bank& b = *get_body(body).played;
  check_place(b, triangle);
  const Vec3 normal = find_normal(b, triangle);
  const std::vector<double> shapes = bank::calc_shapes(b, triangle, barycentric);
  std::vector<float> levels;
  for (std::size_t m = 0; m < b.mode_count(); ++m) {
    const Vec3 shape{shapes[3 * m], shapes[3 * m + 1], shapes[3 * m + 2]};
    levels.push_back(static_cast<float>(std::abs(b.radiation_gain[m] * dot(shape, normal))));
  }
  return levels;
}

std::string Workshop::make_plan(std::string_view scene, std::span<const int> bodies, std::span<const double> words) const {
  scene::Scene described = read_scene(scene, bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const MadeBody& made = get_body(bodies[i]);
    described.bodies[i].spec.bank = made.played.get();
    described.bodies[i].sphere_radius_m = made.scene.bodies[0].sphere_radius_m;
  }
  scene::Events happened(base::Spool({}, "events", kMostEvents));
  std::vector<bool> struck(bodies.size(), false);
  bool is_touched = false;  // interactively, even if nothing in the scene moves
  read_words(words, [&](const events::Event& event, Timing) {
    happened.append(event);
    const auto note = [&](std::int32_t body) {
      if (body >= 0 && body < std::ssize(struck)) struck[body] = true;
    };
    if (const auto* impulse = std::get_if<events::Impulse>(&event)) note(impulse->body);
    if (const auto* force = std::get_if<events::Force>(&event)) note(force->body);
    is_touched = is_touched || std::holds_alternative<events::LastingContact>(event);
  });
  effects::SceneFacts facts = make_scene_facts(described);
  facts.moves = facts.moves || is_touched;
  for (std::size_t i = 0; i < bodies.size(); ++i) facts.bodies[i].struck = facts.bodies[i].struck || struck[i];
  const scene::Plan plan = scene::make_plan(std::move(facts), happened);
  Json json = Json::object();
  for (std::size_t i = 0; i < bodies.size(); ++i)
    json["bodies"].add(
        Json::object().set("name", described.bodies[i].name).set("effects", effects::make_plan_json(plan.selector, static_cast<int>(i))));
  return json.line();
}

std::string Workshop::add_recording(int recording, std::string_view text, const std::string& name, std::span<const int> bodies) {
  Recording made{.bodies = {bodies.begin(), bodies.end()}, .events = events::parse_recording(text, name), .words = {}};
  scene::Scene scene;
  for (const int body : bodies) {
    scene.bodies.push_back(get_body(body).scene.bodies[0]);
    scene.bodies.back().spec.bank = banks_.at(get_body(body).bank).get();  // recorded without edits
  }
  std::vector<std::string> warnings;
  scene::check_bodies(name, made.events.bodies, scene::list_bodies(scene), warnings);
  double duration_s = 0.0;
  for (const events::Event& event : made.events.events) {
    append_words(made.words, event);
    duration_s = std::max(duration_s, events::get_time_s(event));
  }
  Json facts = Json::object();
  facts.set("duration_s", duration_s).set("events", static_cast<std::int64_t>(made.events.events.size()));
  facts.set("words", static_cast<std::int64_t>(made.words.size())).set("warnings", Json::array(warnings));
  for (const events::RecordedBody& body : made.events.bodies) facts["bodies"].add(body.name);
  recordings_[recording] = std::move(made);
  return facts.line();
}

const Workshop::Recording& Workshop::find_recording(int recording) const {
  const auto found = recordings_.find(recording);
  if (found == recordings_.end()) throw InputError(fmt::format("there is no recording {}", recording));
  return found->second;
}

std::string Workshop::plan_recording(std::string_view scene, int recording) const {
  const Recording& of = find_recording(recording);
  return make_plan(scene, of.bodies, of.words);
}

std::span<const double> Workshop::get_recording(int recording) const { return find_recording(recording).words; }

std::vector<double> Workshop::list_poses(int recording, int body) const {
  std::vector<double> poses;
  for (const events::Event& event : find_recording(recording).events.events) {
    const auto* motion = std::get_if<events::BodyMotion>(&event);
    if (motion == nullptr || motion->body != body) continue;
    poses.push_back(motion->time_s);
    poses.insert(poses.end(), motion->position_m.begin(), motion->position_m.end());
    poses.insert(poses.end(), motion->rotation.begin(), motion->rotation.end());
  }
  return poses;
}

}  // namespace carillon::web
