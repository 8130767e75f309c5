#include "runtime/bindings/web/world.hpp"

#include <limits>

#include "runtime/bank/corrected.hpp"
#include "runtime/base/error.hpp"
#include "runtime/bindings/web/event_words.hpp"

namespace carillon::web {
namespace {

/// Takes numbers of a row in order.
struct Row {
  std::span<const double> left;
  double take() {
    if (left.empty()) throw InputError("a description has too few numbers");
    const double x = left.front();
    left = left.subspan(1);
    return x;
  }
  Vec3 take_vector() {
    const double x = take(), y = take(), z = take();
    return {x, y, z};
  }
};

}  // namespace

void PageWorld::add_bank(int bank, std::span<const std::byte> bytes, const std::string& name) {
  banks_[bank] = std::make_unique<const bank::Bank>(bank::choose_frequencies(bank::parse_bank(bytes, name), bank::Frequencies::kCorrected));
}

int PageWorld::add_body(int bank, std::span<const double> numbers, const std::string& name) {
  const auto found = banks_.find(bank);
  if (found == banks_.end()) throw InputError("there is no such bank; add it first");
  if (world_ != nullptr) throw InputError("the world has started; give it all bodies before, absent ones too");
  Row row{numbers};
  physics::BodySpec body;
  body.name = name;
  body.bank = found->second.get();
  body.initial.position_m = row.take_vector();
  for (double& x : body.initial.rotation) x = row.take();
  body.velocity_m_s = row.take_vector();
  body.angular_velocity_rad_s = row.take_vector();
  body.restitution = row.take();
  body.friction = row.take();
  body.rolling_resistance = row.take();
  body.roughness_m = row.take();
  body.fixed = row.take() != 0.0;
  body.absent = row.take() != 0.0;
  spec_.bodies.push_back(std::move(body));
  return static_cast<int>(spec_.bodies.size()) - 1;
}

void PageWorld::start(std::span<const double> numbers) {
  Row row{numbers};
  spec_.gravity_m_s2 = row.take_vector();
  const bool has_ground = row.take() != 0.0;
  physics::GroundSpec ground;
  for (double* number : {&ground.height_m, &ground.young_modulus_pa, &ground.poisson_ratio, &ground.restitution, &ground.friction,
                         &ground.rolling_resistance, &ground.density_kg_m3, &ground.roughness_m})
    *number = row.take();
  if (has_ground) spec_.ground = ground;
  physics::WorldOptions options;
  options.modes = row.take() != 0.0;
  options.masks_hits = row.take() != 0.0;
  world_ = std::make_unique<physics::World>(spec_, options);
}

double PageWorld::advance(double until_s, std::vector<double>& words) {
  return get_world().advance(until_s, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
    if (!std::holds_alternative<events::TimeWatermark>(event)) append_words(words, event);
  });
}

physics::World& PageWorld::get_world() {
  if (world_ == nullptr) throw InputError("the world has not started");
  return *world_;
}

}  // namespace carillon::web
