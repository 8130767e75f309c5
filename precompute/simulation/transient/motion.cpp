// Method: central differences as leapfrog; work of every force h f_n (v_{n-1/2} + v_{n+1/2}) / 2 (exact) and kinetic energy m v_{n-1/2}
//   v_{n+1/2} / 2, which with the elastic energy is constant for a linear body at any stable step. Mass damping acts on the velocity
//   relative to the rigid motion of free or hinged bodies, updated at every output sample.
// Source: docs/equations.md E11; O'Brien, Cook and Essl 2001; Belytschko, Liu and Moran 2000, 6.2 (stable step with lagged damping).
#include "precompute/simulation/transient/motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "precompute/comm/exchange.hpp"
#include "precompute/simulation/transient/order_free_sum.hpp"
#include "precompute/simulation/transient/vectors.hpp"
#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

constexpr int kStartIterations = 50, kCheckIterations = 20;
constexpr double kStartShare = 0.9, kMaxStableShare = 0.95, kRefinedShare = 0.8;
constexpr int kMaxRefinement = 8;

/// Smooth ramp from 0 to 1 with two continuous derivatives.
double calc_ramp(double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

double multiply(const Quad& a, const Quad& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Saved constants, checked on loading.
struct SavedHead {
  char magic[16];
  std::int64_t nodes, elements, sample, step;
  std::int32_t part, parts, first_parts, begun;
  double step_s, step_before_s, act_s, act_before_s, dissipated_j, braked_j, work_j, start_j, most_j, longest_s;
};
constexpr char kMagic[16] = "carillon motion";
constexpr std::size_t kNodeWidth = 10 * 3;

}  // namespace

Motion::Motion(Domain& domain, const MotionOptions& options, std::vector<Constraint> constraints, std::vector<Impulse> impulses)
    : domain_(domain), options_(options), highest_(domain) {
  const comm::Communicator& comm = domain_.get_comm();
  comm.agree([&] {
    check_input(constraints, impulses);
    constraints_ = std::move(constraints);
    impulses_ = std::move(impulses);
    const Assembly& assembly = domain_.get_assembly();
    const std::size_t own = domain_.own_count(), nodes = domain_.node_count();
    for (auto* array : {&u_, &v_}) array->resize(nodes);
    f_.resize(domain_.force_count());
    for (auto* array : {&external_, &work_, &brake_loss_, &carried_, &home_, &reaction_}) array->resize(own);
    is_constrained_.resize(own, 0);
    is_constrained_for_ever_.resize(own, 0);
    for (std::size_t h = 0; h < constraints_.size(); ++h)
      for (const std::int32_t number : constraints_[h].nodes) {
        const std::int32_t place = domain_.find_place(number);
        if (place < 0 || place >= domain_.own_count()) continue;
        is_constrained_[place] = 1;
        is_constrained_for_ever_[place] = std::isfinite(constraints_[h].release_s) ? 0 : 1;
        constrained_nodes_.push_back({place, static_cast<std::int32_t>(h)});
      }
    find_hinges([&](std::int32_t node) { return assembly.nodes_m[node]; });
    for (std::size_t i = 0; i < impulses_.size(); ++i)
      for (const NodeShare& one : impulses_[i].shares) {
        const std::int32_t place = domain_.find_place(one.node);
        if (place >= 0 && place < domain_.own_count()) shares_.push_back({place, static_cast<std::int32_t>(i), one.share});
      }
    for (std::size_t i = 0; i < own; ++i) {
      const double mass = domain_.get_masses_kg()[i];
      const double alpha2 = assembly.bodies[domain_.find_body(static_cast<std::int32_t>(i))].mass_damping_per_s;
      inverse_kg_.push_back(1.0 / mass);
      braked_kg_s_.push_back(is_constrained_[i] != 0 ? 0.0 : alpha2 * mass);
    }
    for (const Assembly::Body& body : assembly.bodies) is_braked_ = is_braked_ || body.mass_damping_per_s > 0.0;
    find_carried();
    has_external_ = is_braked_ || !constraints_.empty() || !impulses_.empty() || norm(options_.gravity_m_s2) > 0.0;
  });
}

void Motion::find_carried() {
  const Assembly& assembly = domain_.get_assembly();
  is_carried_.clear();
  for (const Assembly::Body& body : assembly.bodies) is_carried_.push_back(body.mass_damping_per_s > 0.0 ? 1 : 0);
  next_release_s_ = std::numeric_limits<double>::infinity();
  for (const Constraint& constraint : constraints_) {
    if (constraint.nodes.empty()) continue;  // or released
    next_release_s_ = std::min(next_release_s_, constraint.release_s);
    for (const std::int32_t node : constraint.nodes)
      if (!constraint.is_hinge) is_carried_[assembly.find_body_of_node(node)] = 0;
  }
  has_carried_ = std::find(is_carried_.begin(), is_carried_.end(), 1) != is_carried_.end();
}

void Motion::release() {
  const double now_s = get_time_s() * (1.0 + 1e-12);  // tolerance for a release at a step
  if (now_s < next_release_s_) return;
  const auto is_released = [&](const Constraint& constraint) { return now_s >= constraint.release_s; };
  std::erase_if(constrained_nodes_, [&](const ConstrainedNode& node) {
    if (!is_released(constraints_[node.constraint])) return false;
    const std::size_t place = node.place;
    const std::size_t body = domain_.find_body(node.place);
    is_constrained_[place] = 0;
    reaction_[place] = {};
    braked_kg_s_[place] = domain_.get_assembly().bodies[body].mass_damping_per_s * domain_.get_masses_kg()[place];
    return true;
  });
  for (Constraint& constraint : constraints_)
    if (is_released(constraint)) constraint.nodes.clear();
  find_carried();
}

void Motion::check_input(const std::vector<Constraint>& constraints, const std::vector<Impulse>& impulses) const {
  const Assembly& assembly = domain_.get_assembly();
  if (!(options_.sample_rate_hz > 0.0) || !(options_.longest_step_s > 0.0) || !(options_.settle_s >= 0.0) ||
      !(options_.step_check_s > 0.0) || options_.inversion_check_steps < 1)
    throw InputError("the sample rate, the longest step and the times of checks must be positive, the time to settle not negative");
  std::vector<char> is_constrained(assembly.node_count(), 0);
  const auto check_node = [&](std::int32_t node) {
    if (node < 0 || node >= assembly.node_count())
      throw InputError(fmt::format("node {} is constrained or struck, and there are {} nodes", node, assembly.node_count()));
  };
  for (const Constraint& constraint : constraints) {
    if (!(constraint.release_s >= 0.0)) throw InputError("nodes are let go at a time that is 0 s or later");
    for (const std::int32_t node : constraint.nodes) {
      check_node(node);
      if (std::exchange(is_constrained[node], 1) != 0) {
        const Vec3& x = assembly.nodes_m[node];
        throw InputError(fmt::format("body '{}': the node at ({:.4g}, {:.4g}, {:.4g}) m is constrained twice; name it in one set only",
                                     assembly.bodies[assembly.find_body_of_node(node)].name, x[0], x[1], x[2]));
      }
    }
  }
  for (std::size_t i = 0; i < impulses.size(); ++i) {
    if (!(impulses[i].duration_s > 0.0) || !(impulses[i].time_s >= 0.0) || !std::isfinite(norm(impulses[i].impulse_n_s)))
      throw InputError(fmt::format("impulse {}: its duration must be positive, its time not negative, its vector finite", i + 1));
    for (const NodeShare& one : impulses[i].shares) check_node(one.node);
  }
}

void Motion::add(ExternalForces& forces) {
  outside_.push_back(&forces);
  has_external_ = true;
}

void Motion::set_start(const std::function<Start(std::int32_t, const Vec3&)>& find_start) {
  domain_.get_comm().agree([&] {
    for (std::int32_t i = 0; i < domain_.node_count(); ++i) {
      const std::size_t at = i;
      const Start start = find_start(domain_.find_number(i), domain_.get_rest_m()[at]);
      u_[at] = to_quad(domain_.is_point(i) ? start.displacement_m : Vec3{start.angle_rad, 0.0, 0.0});
      v_[at] = to_quad(domain_.is_point(i) ? start.velocity_m_s : Vec3{});
      if (i >= domain_.own_count() || is_constrained_[at] == 0) continue;
      home_[at] = u_[at];
      v_[at] = Quad{};
    }
    find_hinges([&](std::int32_t node) {
      const Vec3& rest_m = domain_.get_assembly().nodes_m[node];
      return rest_m + find_start(node, rest_m).displacement_m;
    });
  });
}

void Motion::find_hinges(const std::function<Vec3(std::int32_t)>& find_place) {
  hinges_.assign(domain_.get_assembly().bodies.size(), {});
  for (const Constraint& constraint : constraints_) {
    if (!constraint.is_hinge || constraint.nodes.empty()) continue;
    std::vector<Vec3> places_m;
    for (const std::int32_t node : constraint.nodes) places_m.push_back(find_place(node));
    hinges_[domain_.get_assembly().find_body_of_node(constraint.nodes[0])] = make_hinge(places_m);
  }
}

void Motion::begin() {
  begun_ = true;
  find_step(kStartIterations, true);
  // From v_0 to v_{-1/2}: steps symmetric in time from the start.
  domain_.set_elastic_forces(u_.data(), f_.data());
  for (std::size_t i = 0; i < is_constrained_.size(); ++i) {
    if (is_constrained_[i] != 0) continue;
    const double factor = 0.5 * step_s_ * inverse_kg_[i];
    v_[i] = {v_[i].x - factor * f_[i].x, v_[i].y - factor * f_[i].y, v_[i].z - factor * f_[i].z, 0.0};
  }
  domain_.copy_to_halo(v_.data());
  step_before_s_ = act_s_ = step_s_;
  act_before_s_ = 0.0;
  update_carried();
  calc_forces(true);
  const EnergyBook book = calc_book();
  start_j_ = book.kinetic_j + book.elastic_j + book.dissipated_j - book.work_j;
  most_j_ = book.kinetic_j + book.elastic_j + book.dissipated_j;
}

void Motion::find_step(int iterations, bool is_start) {
  const Assembly& assembly = domain_.get_assembly();
  const std::vector<double> omega = highest_.calc(domain_, u_.data(), is_constrained_for_ever_, iterations);
  omega_ = omega;
  longest_s_ = std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < omega.size(); ++b)
    longest_s_ =
        std::min(longest_s_, calc_longest_step(omega[b], calc_alpha1(assembly.bodies[b].law), assembly.bodies[b].mass_damping_per_s));
  for (const ExternalForces* forces : outside_) longest_s_ = std::min(longest_s_, forces->calc_longest_step_s(omega));
  const auto count_parts = [&](double longest_s) {
    const double parts = std::ceil(1.0 / (options_.sample_rate_hz * std::min(longest_s, options_.longest_step_s)));
    if (!(parts < 1e8))
      throw SolveError(
          fmt::format("the shape of the bodies at {:.6g} s, step {}, allows a step of {:.3g} s only", get_time_s(), step_, longest_s));
    const int least = std::max(1, static_cast<int>(parts));
    return options_.round_steps ? options_.round_steps(least) : least;
  };
  const double time_s = get_time_s();
  if (is_start) {
    parts_ = first_parts_ = count_parts(kStartShare * longest_s_);
  } else if (step_s_ > kMaxStableShare * longest_s_) {
    parts_ = count_parts(kRefinedShare * longest_s_);
    if (parts_ > kMaxRefinement * first_parts_)
      throw SolveError(fmt::format(
          "the bodies are so stiff in their shape at {:.6g} s, step {}, that {} steps a sample are needed, over {} times as many as at the "
          "start ({}): the motion is too violent for St. Venant-Kirchhoff's law; use a weaker blow or a finer mesh",
          time_s, step_, parts_, kMaxRefinement, first_parts_));
  }
  step_s_ = 1.0 / (options_.sample_rate_hz * parts_);
}

void Motion::advance_sample() {
  do advance();
  while (!is_at_sample());
}

void Motion::advance() {
  begin_if_new();
  NodeStep step;
  step.nodes = domain_.own_count();
  step.act_s = act_s_;
  step.step_s = step_s_;
  step.inverse_kg = inverse_kg_.data();
  step.force = f_.data();
  if (has_external_) {
    step.external = external_.data();
    step.work = work_.data();
    if (is_braked_) {
      step.braked_kg_s = braked_kg_s_.data();
      step.carried = carried_.data();
      step.brake_loss = brake_loss_.data();
    }
  }
  step.v = v_.data();
  step.u = u_.data();
  domain_.get_loops().step_nodes(step);
  ++step_;
  if (++part_ == parts_) {
    part_ = 0;
    ++sample_;
  }
  step_before_s_ = step_s_;
  act_before_s_ = act_s_;
  domain_.begin_halo(v_.data());
  bool halo_is_there = false;
  if (is_at_sample()) {
    const auto samples = std::max<std::int64_t>(1, std::llround(options_.step_check_s * options_.sample_rate_hz));
    const bool is_due = sample_ % samples == 0;
    if (is_due || has_carried_) {
      domain_.end_halo(v_.data());
      halo_is_there = true;
      move_halo();
    }
    if (is_due) find_step(kCheckIterations, false);
    update_carried();
  }
  act_s_ = 0.5 * (step_before_s_ + step_s_);
  calc_forces(halo_is_there);
  if (step_ % options_.inversion_check_steps == 0) check_inversion();
}

void Motion::move_halo() {
  domain_.get_loops().move_nodes(domain_.node_count() - domain_.own_count(), step_before_s_, v_.data() + domain_.own_count(),
                                 u_.data() + domain_.own_count());
}

void Motion::calc_forces(bool halo_is_there) {
  const StepWeights weights{0.5 * act_s_, 0.5 * act_before_s_, step_before_s_};
  domain_.set_inner_forces(weights, u_.data(), v_.data(), f_.data());
  if (!halo_is_there) {
    domain_.end_halo(v_.data());
    move_halo();
  }
  domain_.add_outer_forces(weights, u_.data(), v_.data(), f_.data());
  if (has_external_) set_external_forces();
}

double Motion::find_next_time_s() const {
  return (static_cast<double>(sample_) + static_cast<double>(part_ + 1) / parts_) / options_.sample_rate_hz;
}

void Motion::set_external_forces() {
  const double time_s = get_time_s();
  const double share = options_.settle_s > 0.0 ? calc_ramp(time_s / options_.settle_s) : 1.0;
  const Vec3 gravity = share * options_.gravity_m_s2;
  const std::vector<double>& mass = domain_.get_masses_kg();
  for (std::size_t i = 0; i < external_.size(); ++i)
    external_[i] = domain_.is_point(static_cast<std::int32_t>(i))
                       ? Quad{mass[i] * gravity[0], mass[i] * gravity[1], mass[i] * gravity[2], 0.0}
                       : Quad{};
  for (const OwnShare& one : shares_) {
    const Impulse& impulse = impulses_[one.impulse];
    const double x = (time_s - impulse.time_s) / impulse.duration_s;
    if (!(x > 0.0 && x < 1.0)) continue;
    const double factor = one.share * (1.0 - std::cos(2.0 * std::numbers::pi * x)) / impulse.duration_s;
    Quad& f = external_[one.place];
    f.x += factor * impulse.impulse_n_s[0];
    f.y += factor * impulse.impulse_n_s[1];
    f.z += factor * impulse.impulse_n_s[2];
  }
  if (is_braked_)
    for (std::size_t i = 0; i < external_.size(); ++i) {
      external_[i].x -= braked_kg_s_[i] * (v_[i].x - carried_[i].x);
      external_[i].y -= braked_kg_s_[i] * (v_[i].y - carried_[i].y);
      external_[i].z -= braked_kg_s_[i] * (v_[i].z - carried_[i].z);
    }
  const StepTime time{step_, time_s, act_s_, act_before_s_, step_s_, step_before_s_};
  for (ExternalForces* forces : outside_) forces->add_forces(time, u_.data(), v_.data(), external_.data());
  release();
  // The support force moves a node to its prescribed position.
  std::vector<Vec3> next;
  for (const Constraint& constraint : constraints_) next.push_back(constraint.path.calc(find_next_time_s()));
  for (const ConstrainedNode& constrained : constrained_nodes_) {
    const std::size_t i = constrained.place;
    const Vec3 to = to_vector(home_[i]) + next[constrained.constraint];
    const double factor = mass[i] / act_s_;
    const Quad others = external_[i];
    external_[i] = {factor * ((to[0] - u_[i].x) / step_s_ - v_[i].x) - f_[i].x, factor * ((to[1] - u_[i].y) / step_s_ - v_[i].y) - f_[i].y,
                    factor * ((to[2] - u_[i].z) / step_s_ - v_[i].z) - f_[i].z, 0.0};
    reaction_[i] = {external_[i].x - others.x, external_[i].y - others.y, external_[i].z - others.z, 0.0};
  }
}

Vec3 Motion::calc_reaction(std::size_t constraint) {
  begin_if_new();
  std::vector<OrderFreeSum> sums(3);
  for (const ConstrainedNode& constrained : constrained_nodes_) {
    if (static_cast<std::size_t>(constrained.constraint) != constraint || !domain_.is_point(constrained.place)) continue;
    const Quad& f = reaction_[constrained.place];
    sums[0].add(f.x);
    sums[1].add(f.y);
    sums[2].add(f.z);
  }
  const std::vector<double> sum = calc_sums(domain_.get_comm(), sums);
  return {sum[0], sum[1], sum[2]};
}

void Motion::update_carried() {
  if (!has_carried_) return;
  const std::vector<RigidMotion> rigid = calc_rigid_motions(domain_, u_, v_, is_carried_, hinges_);
  for (std::size_t i = 0; i < carried_.size(); ++i) {
    const auto node = static_cast<std::int32_t>(i);
    if (!domain_.is_point(node)) continue;
    const Vec3 place_m = domain_.get_rest_m()[i] + to_vector(u_[i]);
    carried_[i] = to_quad(rigid[domain_.find_body(node)].calc_velocity(place_m));
  }
}

void Motion::check_inversion() {
  const Domain::State state = domain_.calc_state(u_.data());
  double least = std::numeric_limits<double>::infinity();
  std::int32_t element = std::numeric_limits<std::int32_t>::max();
  for (std::size_t i = 0; i < state.element.size(); ++i) {
    // Non-finite values take precedence.
    const double det = std::isfinite(state.least_det[i]) ? state.least_det[i] : -std::numeric_limits<double>::infinity();
    if (det < least || (det == least && state.element[i] < element)) {
      least = det;
      element = state.element[i];
    }
  }
  const comm::Communicator& comm = domain_.get_comm();
  const double least_of_all = comm.min(least);
  if (least_of_all > 0.0) return;
  const std::int32_t first = comm.min(least == least_of_all ? element : std::numeric_limits<std::int32_t>::max());
  const std::string where =
      fmt::format("{} is turned inside out at {:.6g} s, step {} (det F {:.3g}): ", domain_.get_assembly().describe(first), get_time_s(),
                  step_, least_of_all);
  // Between two step checks a body may stiffen; then the step failed, not the law.
  if (step_s_ > kMaxStableShare * longest_s_)
    throw SolveError(where +
                     fmt::format("the step of {:.3g} s is not below 0.95 of the longest stable one, {:.3g} s: the motion is unstable; "
                                 "give a shorter \"step_s\"",
                                 step_s_, longest_s_));
  throw SolveError(where +
                   "St. Venant-Kirchhoff's law does not resist strong compression; use a weaker blow, a finer mesh or a stiffer material");
}

EnergyBook Motion::calc_book() {
  begin_if_new();
  std::vector<OrderFreeSum> sums(7);
  const std::vector<double>& mass = domain_.get_masses_kg();
  for (std::size_t i = 0; i < inverse_kg_.size(); ++i) {
    const Quad& v = v_[i];
    double power = multiply(f_[i], v);
    if (has_external_) {
      const double external = multiply(external_[i], v);
      power += external;
      sums[2].add(work_[i].x + work_[i].y + work_[i].z);
      sums[4].add(0.5 * act_s_ * external);
      work_[i] = {};
      if (is_braked_) {
        const Quad relative{v.x - carried_[i].x, v.y - carried_[i].y, v.z - carried_[i].z, 0.0};
        sums[3].add(brake_loss_[i].x + brake_loss_[i].y + brake_loss_[i].z);
        brake_loss_[i] = {};
        const double braked = 0.5 * act_s_ * braked_kg_s_[i] * multiply(relative, v);
        sums[4].add(braked);
        sums[6].add(braked);
      }
    }
    sums[0].add(0.5 * (mass[i] * multiply(v, v) + act_s_ * power));
  }
  const Domain::State state = domain_.calc_state(u_.data());
  for (const double energy : state.energy_j) sums[1].add(energy);
  for (const double value : domain_.list_spent()) sums[5].add(value);
  domain_.forget_spent();
  const std::vector<double> sum = calc_sums(domain_.get_comm(), sums);
  // The second half of the last step's damping work is not known yet, and the first half is among those in sum[5].
  dissipated_j_ += sum[5];
  braked_j_ += sum[3];
  work_j_ += sum[2] + sum[3];
  EnergyBook book;
  book.time_s = get_time_s();
  book.step = step_;
  book.kinetic_j = sum[0];
  book.elastic_j = sum[1];
  book.dissipated_j = dissipated_j_ + braked_j_ + sum[6];
  book.work_j = work_j_ + sum[4];
  const double balance = book.kinetic_j + book.elastic_j + book.dissipated_j;
  most_j_ = std::max(most_j_, balance);
  book.error_j = balance - book.work_j - start_j_;
  book.relative_error = most_j_ > 0.0 ? book.error_j / most_j_ : 0.0;
  return book;
}

Motion::Momentum Motion::calc_momentum() {
  begin_if_new();
  std::vector<OrderFreeSum> sums(6);
  for (std::size_t i = 0; i < inverse_kg_.size(); ++i) {
    if (!domain_.is_point(static_cast<std::int32_t>(i))) continue;
    // Position half a step ago: the angular momentum of both half steps is equal there.
    const double half = 0.5 * step_before_s_;
    const Vec3 v = to_vector(v_[i]), x = domain_.get_rest_m()[i] + to_vector(u_[i]) - half * v, turn = cross(x, v);
    for (std::size_t k = 0; k < 3; ++k) {
      sums[k].add(domain_.get_masses_kg()[i] * v[k]);
      sums[3 + k].add(domain_.get_masses_kg()[i] * turn[k]);
    }
  }
  const std::vector<double> sum = calc_sums(domain_.get_comm(), sums);
  return {{sum[0], sum[1], sum[2]}, {sum[3], sum[4], sum[5]}};
}

std::vector<std::byte> Motion::save() {
  begin_if_new();
  const comm::Communicator& comm = domain_.get_comm();
  std::vector<std::int32_t> element;
  std::vector<double> of_element;
  std::vector<std::int32_t> node;
  std::vector<double> of_node;
  comm.agree([&] {
    domain_.save_elements(element, of_element);
    for (std::int32_t i = 0; i < domain_.own_count(); ++i) {
      const std::size_t at = i;
      node.push_back(domain_.find_number(i));
      for (const Quad& q : {u_[at], v_[at], f_[at], external_[at], work_[at], brake_loss_[at], carried_[at], highest_.get_vectors()[at],
                            home_[at], reaction_[at]})
        for (const double value : {q.x, q.y, q.z}) of_node.push_back(value);
    }
  });
  const auto all_nodes = comm::gather(comm, node);
  const auto all_of_node = comm::gather(comm, of_node);
  const auto all_elements = comm::gather(comm, element);
  const auto all_of_element = comm::gather(comm, of_element);
  std::vector<std::byte> bytes;
  comm.agree([&] {
    if (!comm.is_root()) return;
    const std::size_t nodes = domain_.get_assembly().node_count(), elements = domain_.get_assembly().element_count();
    SavedHead head{};
    std::memcpy(head.magic, kMagic, sizeof(kMagic));
    head.nodes = static_cast<std::int64_t>(nodes);
    head.elements = static_cast<std::int64_t>(elements);
    head.sample = sample_;
    head.step = step_;
    head.part = part_;
    head.parts = parts_;
    head.first_parts = first_parts_;
    head.begun = 1;
    head.step_s = step_s_;
    head.step_before_s = step_before_s_;
    head.act_s = act_s_;
    head.act_before_s = act_before_s_;
    head.dissipated_j = dissipated_j_;
    head.braked_j = braked_j_;
    head.work_j = work_j_;
    head.start_j = start_j_;
    head.most_j = most_j_;
    head.longest_s = longest_s_;
    bytes.resize(sizeof(head) + (nodes * kNodeWidth + elements * Solids::kStateWidth + omega_.size()) * sizeof(double));
    std::memcpy(bytes.data(), &head, sizeof(head));
    std::byte* to = bytes.data() + sizeof(head);
    const auto place = [&](const std::vector<std::int32_t>& numbers, const std::vector<double>& values, std::size_t width) {
      for (std::size_t i = 0; i < numbers.size(); ++i)
        std::memcpy(to + static_cast<std::size_t>(numbers[i]) * width * sizeof(double), values.data() + i * width, width * sizeof(double));
    };
    place(all_nodes, all_of_node, kNodeWidth);
    to += nodes * kNodeWidth * sizeof(double);
    place(all_elements, all_of_element, Solids::kStateWidth);
    to += elements * Solids::kStateWidth * sizeof(double);
    std::memcpy(to, omega_.data(), omega_.size() * sizeof(double));
  });
  return bytes;
}

void Motion::load(std::span<const std::byte> bytes) {
  const comm::Communicator& comm = domain_.get_comm();
  const auto nodes = static_cast<std::size_t>(domain_.get_assembly().node_count()),
             elements = static_cast<std::size_t>(domain_.get_assembly().element_count()), bodies = domain_.get_assembly().bodies.size();
  std::vector<std::byte> all = comm.broadcast([&] {
    SavedHead head{};
    const std::size_t wanted = sizeof(head) + (nodes * kNodeWidth + elements * Solids::kStateWidth + bodies) * sizeof(double);
    if (bytes.size() >= sizeof(head)) std::memcpy(&head, bytes.data(), sizeof(head));
    if (bytes.size() != wanted || std::memcmp(head.magic, kMagic, sizeof(kMagic)) != 0 || head.nodes != static_cast<std::int64_t>(nodes) ||
        head.elements != static_cast<std::int64_t>(elements) || head.parts < 1 || head.part < 0 || head.part >= head.parts)
      throw InputError(
          fmt::format("the saved motion is not of these bodies, of {} nodes and {} elements, or it is cut off; run it again from the start",
                      nodes, elements));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  });
  comm.agree([&] {
    SavedHead head{};
    std::memcpy(&head, all.data(), sizeof(head));
    std::vector<double> values((all.size() - sizeof(head)) / sizeof(double));
    std::memcpy(values.data(), all.data() + sizeof(head), values.size() * sizeof(double));
    for (std::int32_t i = 0; i < domain_.node_count(); ++i) {
      const std::size_t at = i;
      const double* from = values.data() + static_cast<std::size_t>(domain_.find_number(i)) * kNodeWidth;
      std::vector<Quad*> targets{&u_[at], &v_[at]};
      if (i < domain_.own_count())
        targets.insert(targets.end(), {&f_[at], &external_[at], &work_[at], &brake_loss_[at], &carried_[at], &highest_.get_vectors()[at],
                                       &home_[at], &reaction_[at]});
      for (std::size_t k = 0; k < targets.size(); ++k) *targets[k] = {from[3 * k], from[3 * k + 1], from[3 * k + 2], 0.0};
    }
    domain_.load_elements(std::span(values).subspan(nodes * kNodeWidth, elements * Solids::kStateWidth));
    omega_.assign(values.end() - static_cast<std::ptrdiff_t>(bodies), values.end());
    sample_ = head.sample;
    step_ = head.step;
    part_ = head.part;
    parts_ = head.parts;
    first_parts_ = head.first_parts;
    step_s_ = head.step_s;
    step_before_s_ = head.step_before_s;
    act_s_ = head.act_s;
    act_before_s_ = head.act_before_s;
    dissipated_j_ = head.dissipated_j;
    braked_j_ = head.braked_j;
    work_j_ = head.work_j;
    start_j_ = head.start_j;
    most_j_ = head.most_j;
    longest_s_ = head.longest_s;
    begun_ = true;
    release();
  });
}

}  // namespace carillon::transient
