// Method: windows in which bodies that can meet nothing fly; boxes of the space that each body may reach in a window give the near pairs. A
// body accelerated by an impact beyond its planned speed is checked again.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996): bounds of reach, flight in closed form.
#include "runtime/physics/rigid/windows.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>
#include <utility>

#include "runtime/physics/geometry/boxes.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMaxSteps = 1024;  // per window
constexpr double kLongStepRatio =
    0.15;                          // fraction of the thinner body's thickness: a pair that moves this far in a long step takes short ones
constexpr double kArcSagM = 5e-6;  // m; permitted deviation of a point on an arc from its chord in a step,
constexpr double kArcSagRatio = 5e-4;       // the same relative to the thickness of its body
constexpr double kRollingArcRatio = 4.0;    // times the arc bounded by a body's box: keeps long rolling bodies within 50 um
constexpr double kSpanningArcRatio = 0.02;  // the same on smooth touches far apart, which follow the surface
constexpr double kFlatStepRatio = 2.0;      // times the step of others: for groups with flat contacts only
constexpr double kBoxMarginM = 1e-4;        // m; enlargement of boxes
// A body that rolls alone on smooth touches takes longer steps:
constexpr double kRollingStepRatio = 4.0;  // longest step, times options.step_s
constexpr double kQuietS = 10e-3;          // s; required time without an impact
constexpr double kNearRatio = 0.02;        // fraction of its size,
constexpr double kTravelRatio = 3.0;       // or touch travel per window: no vertex farther from the touches may come down
constexpr double kMaxTurnRad = 0.25;       // rad; maximum rotation of a normal in the body per step
constexpr double kMaxSpanRatio = 0.25;     // fraction of its size: touches farther apart prevent hopping

}  // namespace

Windows::Windows(Bodies& bodies, TouchSets& touches, const Options& options, Ledger& ledger)
    : bodies_(bodies),
      touches_(touches),
      options_(options),
      ledger_(ledger),
      active_(bodies),
      flying_(bodies),
      strides_(bodies, 1),
      rolling_(bodies),
      reach_m_s_(bodies),
      flew_from_(bodies),
      articulation_flew_from_(bodies.articulations().size()) {}

void Windows::add(Pair& pair) {
  if (pair.window == number_) return;
  pair.window = number_;
  if (pair.cord >= 0) touches_.refresh(pair);
  near_.push_back(&pair);
  near_is_sorted_ = false;
}

void Windows::forget(int body) {
  std::erase_if(near_, [&](const Pair* pair) { return pair->a == body || pair->b == body; });
}

void Windows::add(int a, int b) {
  if (b >= 0 && a > b) std::swap(a, b);
  if (!bodies_.is_joined(a, b)) add(touches_.get(a, b));
}

void Windows::sort_near() {
  if (near_is_sorted_) return;
  std::sort(near_.begin(), near_.end(),
            [](const Pair* x, const Pair* y) { return std::tuple(x->a, x->b, x->cord) < std::tuple(y->a, y->b, y->cord); });
  near_is_sorted_ = true;
}

void Windows::open(double end_s, const std::list<ModalImpact>& impacts) {
  ++number_;
  start_s_ = bodies_.get_time();
  end_s_ = std::min(static_cast<double>(number_) * kLength, end_s);
  const double length = get_length(), g = norm(bodies_.gravity());
  near_.clear();
  near_is_sorted_ = true;
  const int count = bodies_.count();
  std::vector<geometry::Box> boxes(count);
  for (int i = 0; i < count; ++i) {
    active_[i] = flying_[i] = 0;
    reach_m_s_[i] = bodies_.moves(i) ? bodies_.calc_speed(i) + g * length : 0.0;
    if (const Articulation* articulation = bodies_.find_articulation(i); articulation != nullptr && bodies_.moves(i))
      reach_m_s_[i] += bodies_.calc_joint_acceleration(*articulation) * length;
    if (bodies_.moves(i)) reach_m_s_[i] += bodies_.get_pull(i) * length;
    boxes[i] = bodies_.calc_box(i, bodies_.moves(i) ? reach_m_s_[i] * length + bodies_.get_swing(i) + kBoxMarginM : 0.0);
  }
  for (int i = 0; i < count; ++i)
    if (bodies_.moves(i) && bodies_.ground() && boxes[i].low[2] < bodies_.ground()->height_m) add(i, -1), active_[i] = 1;
  geometry::for_overlaps(boxes, [&](int i, int j) {
    if ((!bodies_.moves(i) && !bodies_.moves(j)) || bodies_.is_joined(i, j) || bodies_.is_absent(i) || bodies_.is_absent(j)) return;
    add(i, j);
    active_[i] = active_[j] = 1;
  });
  open_cords();
  for (const ModalImpact& impact : impacts)
    for (const int body : impact.bodies) active_[body] = 1;
  for (const Grab& grab : bodies_.grabs()) active_[grab.body] = 1;
  // A member that may meet something prevents the flight of the whole articulation.
  for (const Articulation& articulation : bodies_.articulations())
    if (std::any_of(articulation.bodies.begin(), articulation.bodies.end(), [&](int body) { return active_[body] != 0; }))
      for (const int body : articulation.bodies) active_[body] = 1;
  sort_near();
  touches_.forget_far(number_);
}

/// Cords that may become taut within the window; their bodies do not fly.
void Windows::open_cords() {
  for (Pair& pair : touches_.cord_pairs()) {
    if (!bodies_.moves(pair.a) && !bodies_.moves(pair.b)) continue;
    touches_.refresh(pair);
    double speed = 0.0;
    for (const int body : {pair.a, pair.b})
      if (body >= 0) speed += reach_m_s_[body];
    if (pair.contacts.front().touch.gap_m > speed * get_length() + kBoxMarginM) {
      pair.contacts.front().touching = false;
      continue;
    }
    add(pair);
    for (const int body : {pair.a, pair.b})
      if (body >= 0) active_[body] = 1;
  }
}

const std::vector<int>& Windows::fly_bodies() {
  any_active_ = false;
  flown_.clear();
  bool any = false;
  for (int i = 0; i < bodies_.count(); ++i) {
    if (!bodies_.moves(i)) continue;
    any = true;
    if (active_[i] || !options_.islands) {
      any_active_ = true;
      continue;
    }
    if (bodies_.find_articulation(i) != nullptr) continue;
    flying_[i] = 1;
    flown_.push_back(i);
    State& state = bodies_.state(i);
    flew_from_[i] = state;
    state = rigid::fly(bodies_.solid(i), state, bodies_.gravity(), get_length());
    bodies_.place(i);
    ++ledger_.costs.body_steps;
  }
  if (any) ++ledger_.costs.steps;
  return flown_;
}

bool Windows::may_fly(const Articulation& articulation) const {
  const int first = articulation.bodies.front();
  return bodies_.moves(first) && !active_[first] && options_.islands;
}

void Windows::fly(Articulation& articulation) {
  articulation_flew_from_[&articulation - bodies_.articulations().data()] = articulation.now;
  articulation.now = bodies_.fly(articulation, articulation.now, get_length());
  bodies_.place(articulation);
  ++ledger_.costs.flights;
  for (const int body : articulation.bodies) flying_[body] = 1;
  ledger_.costs.body_steps += static_cast<std::int64_t>(articulation.bodies.size());
}

/// Joins groups connected by sleeping bodies: an impact that wakes these merges the groups within the window.
void Windows::join_sleeping(base::Groups& groups) const {
  const auto join = [&](const Pair& pair) {
    if (!bodies_.is_fixed(pair.a) && !bodies_.is_fixed(pair.b)) groups.join(pair.a, pair.b);
  };
  for (const Pair* pair : near_) join(*pair);
  for (const auto& [key, pair] : touches_.pairs())
    if (pair.touches()) join(pair);
  for (const Pair& pair : touches_.cord_pairs())
    if (pair.touches()) join(pair);
  for (const Articulation& articulation : bodies_.articulations())
    for (const int body : articulation.bodies) groups.join(articulation.bodies.front(), body);
}

/// Finds bodies that roll alone and their number of steps from the errors of the last window. The change of a gap is proportional to the
/// cube of the step.
void Windows::find_rolling(base::Groups& groups) {
  const int count = bodies_.count();
  const double most = get_length() / options_.step_s;
  const auto find_steps = [&](int body) { return rolling_[body].steps > 0 ? rolling_[body].steps : most; };  // in the last window
  std::vector<int> sizes(count, 0);
  for (int i = 0; i < count; ++i) ++sizes[groups.find(i)];
  std::vector<char> rolls(count, 0), touches(count, 0);
  for (int i = 0; i < count; ++i) {
    rolls[i] = bodies_.moves(i) && sizes[groups.find(i)] == 1 && !bodies_.is_flat(i) && bodies_.find_articulation(i) == nullptr &&
               bodies_.get_pull(i) == 0.0 && !bodies_.is_in_impact(i) && start_s_ - bodies_.get_struck_s(i) > kQuietS;
  }
  std::vector<double> errors(count, 0.0);  // relative to the permitted ones
  std::vector<Vec3> stations;
  for (Pair* pair : near_) {
    const int body = bodies_.moves(pair->a) ? pair->a : pair->b;
    if (!bodies_.moves(body)) continue;
    const Pair::Errors last = std::exchange(pair->errors, {});
    errors[body] = std::max({errors[body], std::cbrt(last.drift_m / (pair->b < 0 ? kGroundDriftM : kGapDriftM)), last.turn / kMaxTurnRad});
    if (pair->cord >= 0 || pair->sag_m > 0.0) rolls[body] = 0;
    if (rolls[body] == 0) continue;
    stations.clear();
    Vec3 up{};
    for (const Contact& c : pair->contacts) {
      if (c.presses || (c.touching && !c.touch.smooth)) rolls[body] = 0;
      if (!c.is_close()) continue;
      stations.push_back(body == pair->a ? c.touch.station_a : c.touch.station_b);
      up = (body == pair->a ? 1.0 : -1.0) * c.touch.normal;
    }
    if (stations.empty()) continue;
    touches[body] = 1;
    const geometry::Shape& shape = *bodies_.get_shape(body);
    rolling_[body].spans = norm(stations.front() - stations.back()) > kMaxSpanRatio * shape.get_size_m();
    const double far_m = std::max(kNearRatio * shape.get_size_m(), kTravelRatio * last.way_m * find_steps(body));
    if (geometry::may_tip(shape, bodies_.get_frame(body), up, bodies_.placed(body).spin, stations, far_m, get_length()))
      rolls[body] = 0;
    else if (pair->b < 0)
      pair->renew_search();
  }
  for (int i = 0; i < count; ++i) {
    Rolling& r = rolling_[i];
    const double before = find_steps(i);
    r.asked = rolls[i] == 0 || touches[i] == 0
                  ? 0.0
                  : std::clamp(std::max(errors[i], 0.5) * before, std::max(most / kRollingStepRatio, 1.0), most);
  }
}

void Windows::choose_steps() {
  const double length_s = get_length();
  const int count = bodies_.count();
  base::Groups groups(count);
  for (const Pair* pair : near_)
    if (bodies_.moves(pair->a) && bodies_.moves(pair->b)) groups.join(pair->a, pair->b);
  islands_ = 0;
  bool any_asleep = false;
  for (int i = 0; i < count; ++i) {
    if (!bodies_.is_fixed(i) && groups.find(i) == i) ++islands_;
    any_asleep = any_asleep || bodies_.is_asleep(i);
  }
  if (any_asleep) join_sleeping(groups);
  const double g = norm(bodies_.gravity());
  find_rolling(groups);
  std::vector<double> steps(count, std::max(1.0, length_s / (kFlatStepRatio * options_.step_s)));
  for (int i = 0; i < count; ++i)
    if (rolling_[i].asked > 0.0) steps[groups.find(i)] = rolling_[i].asked;
  const auto ask = [&](int body, double asked) {
    double& max = steps[groups.find(body)];
    max = std::max(max, asked);
  };
  for (const Pair* pair : near_) {
    const int body = bodies_.moves(pair->a) ? pair->a : pair->b;
    if (!bodies_.moves(body)) continue;
    // Bodies that are fast for their size must not pass through each other between searches, and thin ones must not sink in.
    const double speed = bodies_.calc_closing_speed(pair->a, pair->b) + g * length_s;
    ask(body, 2.0 * length_s * speed / (kSearchRangeRatio * bodies_.calc_size(pair->a, pair->b)));
    if (rolling_[body].asked > 0.0) continue;
    const bool is_thin = kFlatStepRatio * options_.step_s * speed > kLongStepRatio * bodies_.calc_thickness(pair->a, pair->b);
    if (is_thin || pair->cord >= 0 || !bodies_.is_flat(pair->a) || !bodies_.is_flat(pair->b)) ask(body, length_s / options_.step_s);
  }
  for (int i = 0; i < count; ++i) {
    if (!bodies_.moves(i)) continue;
    if (bodies_.find_articulation(i) != nullptr || bodies_.is_moved_by_impact(i) || bodies_.get_pull(i) > 0.0)
      ask(i, length_s / options_.step_s);
    // A point on an arc leaves its chord by w v h^2 / 2 within a step, with v its speed due to the spin w, at most w times the radius.
    const Solid& solid = bodies_.solid(i);
    const double sag = std::max(kArcSagM, kArcSagRatio * solid.shape->get_thickness_m());
    const double spin = norm(bodies_.placed(i).spin);
    const double rolls = rolling_[i].asked > 0.0 && rolling_[i].spans ? kSpanningArcRatio : kRollingArcRatio;
    ask(i, length_s * std::sqrt(spin * std::min(rolls * bodies_.calc_turning_speed(i), spin * solid.radius_m) / (2.0 * sag)));
  }
  // Powers of two: the steps of a group do not depend on other groups.
  const auto round = [](double n) {
    return static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::ceil(std::min(n, kMaxSteps) - 1e-6))));
  };
  steps_ = 1;
  for (int i = 0; i < count; ++i)
    if (any_active_ && bodies_.moves(i)) steps_ = std::max(steps_, round(steps[groups.find(i)]));
  for (int i = 0; i < count; ++i) {
    strides_[i] = std::max(1, steps_ / round(options_.islands ? steps[groups.find(i)] : steps_));
    rolling_[i].steps = rolling_[i].asked > 0.0 ? steps_ / strides_[i] : 0;
  }
  step_ = 0;
}

void Windows::skip(double end_s) {
  ++number_;
  near_.clear();
  start_s_ = end_s_ = std::min(static_cast<double>(number_) * kLength, end_s);
}

int Windows::find_stride(const Pair& pair) const {
  const bool a_moves = bodies_.moves(pair.a), b_moves = bodies_.moves(pair.b);
  if ((!a_moves && !b_moves) || (a_moves && !is_due(pair.a)) || (b_moves && !is_due(pair.b))) return 0;
  return std::max(a_moves ? strides_[pair.a] : 1, b_moves ? strides_[pair.b] : 1);
}

std::vector<Island> Windows::make_islands(const std::list<ModalImpact>& impacts) {
  const int count = bodies_.count();
  base::Groups groups(count);
  for (Pair* pair : near_)
    if (bodies_.moves(pair->a) && bodies_.moves(pair->b) && is_due(pair->a) && is_due(pair->b) &&
        touches_.may_meet(*pair, calc_length(std::max(strides_[pair->a], strides_[pair->b]))))
      groups.join(pair->a, pair->b);
  for (const ModalImpact& impact : impacts) {
    int first = -1;
    for (const int body : impact.bodies) {
      if (!bodies_.moves(body)) continue;
      if (first < 0) first = body;
      groups.join(first, body);
    }
  }
  for (const Articulation& articulation : bodies_.articulations())
    if (bodies_.moves(articulation.bodies.front()))
      for (const int body : articulation.bodies) groups.join(articulation.bodies.front(), body);
  if (!options_.islands)
    for (int i = 0; i < count; ++i)
      if (bodies_.moves(i)) groups.join(0, i);
  std::vector<Island> islands;
  std::vector<int> number(count, -1);
  for (int i = 0; i < count; ++i) {
    if (!bodies_.moves(i) || flying_[i] || !is_due(i)) continue;
    int& n = number[groups.find(i)];
    if (n < 0) {
      n = static_cast<int>(islands.size());
      islands.emplace_back();
    }
    Island& island = islands[n];
    island.stride = island.bodies.empty() ? strides_[i] : std::min(island.stride, strides_[i]);
    island.bodies.push_back(i);
  }
  for (const Island& island : islands)
    for (const int body : island.bodies) strides_[body] = island.stride;
  for (Pair* pair : near_) {
    const int body = bodies_.moves(pair->a) ? pair->a : pair->b;
    if (!bodies_.moves(body) || !is_due(body)) continue;
    const int n = number[groups.find(body)];
    if (n >= 0) islands[n].pairs.push_back(pair);
  }
  return islands;
}

void Windows::wake(int body, int by) {
  flying_[body] = 0;
  strides_[body] = strides_[by];
  reach_m_s_[body] = norm(bodies_.gravity()) * kLength;
}

/// Moves a body that flew to the end of the window back to the end of the current step of the body that may meet it, and gives it the same
/// steps.
void Windows::undo_flight(int body, int by) {
  if (body < 0 || !flying_[body]) return;
  const double flown_s = find_time(step_ + strides_[by]) - start_s_;
  if (Articulation* articulation = bodies_.find_articulation(body); articulation != nullptr) {
    articulation->now = bodies_.fly(*articulation, articulation_flew_from_[articulation - bodies_.articulations().data()], flown_s);
    bodies_.place(*articulation);
    for (const int other : articulation->bodies) flying_[other] = 0, strides_[other] = strides_[by];
    return;
  }
  flying_[body] = 0;
  strides_[body] = strides_[by];
  bodies_.state(body) = rigid::fly(bodies_.solid(body), flew_from_[body], bodies_.gravity(), flown_s);
  bodies_.place(body);
}

void Windows::extend(int body, double least_m_s) {
  bodies_.note_struck(body);
  const double left = end_s_ - bodies_.get_time();
  const double others_left = end_s_ - get_time();  // remaining time of islands that have not been stepped
  const double speed = std::max(bodies_.calc_speed(body), least_m_s) + norm(bodies_.gravity()) * left;
  if (speed <= reach_m_s_[body]) return;
  reach_m_s_[body] = speed;
  const geometry::Box box = bodies_.calc_box(body, speed * left + bodies_.get_swing(body) + kBoxMarginM);
  if (bodies_.ground() && box.low[2] < bodies_.ground()->height_m) add(body, -1);
  for (int j = 0; j < bodies_.count(); ++j) {
    if (j == body || bodies_.is_absent(j)) continue;
    const double reach_m =
        bodies_.moves(j) ? reach_m_s_[j] * (flying_[j] ? kLength : others_left) + bodies_.get_swing(j) + kBoxMarginM : 0.0;
    if (!box.overlaps(bodies_.calc_box(j, reach_m)) || bodies_.is_joined(body, j)) continue;
    undo_flight(j, body);
    add(body, j);
  }
  for (Pair& pair : touches_.cord_pairs())
    if (pair.a == body || pair.b == body) {
      undo_flight(pair.a, body);
      undo_flight(pair.b, body);
      add(pair);
    }
}

}  // namespace carillon::rigid
