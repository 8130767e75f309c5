// Method: every rank has the assembly, keeps its nodes, and lists the elements that touch one of them. docs/equations.md E11.
#include "precompute/simulation/transient/domain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/mesh/distributed/bisect.hpp"
#include "runtime/base/error.hpp"

namespace carillon::transient {
namespace {

constexpr double kSliverShare = 0.2;

std::vector<std::int32_t> cut(const comm::Communicator& comm, const Assembly& assembly) {
  const std::size_t elements = assembly.element_count();
  if (comm.size() == 1) return std::vector<std::int32_t>(elements, 0);
  const bool has_sheets =
      std::any_of(assembly.bodies.begin(), assembly.bodies.end(), [](const Assembly::Body& body) { return body.is_sheet; });
  if (!has_sheets)
    return comm.broadcast([&] {
      std::vector<std::int32_t> corners;
      corners.reserve(4 * elements);
      for (std::int32_t e = 0; e < assembly.element_count(); ++e) {
        const auto nodes = assembly.find_nodes(e);
        corners.insert(corners.end(), nodes.begin(), nodes.begin() + 4);
      }
      return partition::partition_elements(corners, comm.size()).part;
    });
  comm.agree([&] {
    if (elements < static_cast<std::size_t>(comm.size()))
      throw InputError(fmt::format("there are {} elements for {} ranks; take fewer ranks", elements, comm.size()));
  });
  const std::size_t ranks = comm.size(), rank = comm.rank();
  const std::size_t first = elements * rank / ranks, last = elements * (rank + 1) / ranks;
  std::vector<Vec3> centres;
  for (std::size_t e = first; e < last; ++e) {
    Vec3 centre{};
    for (std::size_t a = 0; a < 3; ++a)
      centre = centre + 1.0 / 3.0 * assembly.nodes_m[assembly.find_nodes(static_cast<std::int32_t>(e))[a]];
    centres.push_back(centre);
  }
  return comm.all_gather(mesh::bisect(comm, centres, static_cast<std::int64_t>(first)));
}

/// Step limit [s] of a sheet triangle alone: least height over the speed of a plane wave.
double calc_triangle_step(const Assembly& assembly, std::int32_t element) {
  const Assembly::Body& body = assembly.bodies[assembly.find_body(element)];
  const auto nodes = assembly.find_nodes(element);
  std::array<Vec3, 3> at{};
  for (std::size_t c = 0; c < 3; ++c) at[c] = assembly.nodes_m[nodes[c]];
  double longest = 0;
  for (std::size_t c = 0; c < 3; ++c) longest = std::max(longest, norm(at[(c + 1) % 3] - at[c]));
  const SheetLaw& law = body.sheet_law;
  const double plane = 4.0 * law.mu_pa * (law.lambda_pa + law.mu_pa) / (law.lambda_pa + 2.0 * law.mu_pa);
  return norm(cross(at[1] - at[0], at[2] - at[0])) / longest / std::sqrt(plane / law.density_kg_m3);
}

/// Rank of each node. Seam nodes between two parts are split in half by number (hence by position): both ranks compute half of the seam
/// elements redundantly, rather than one rank all.
std::vector<std::int32_t> find_owners(const Assembly& all, const std::vector<std::int32_t>& part) {
  const std::size_t nodes = all.node_count();
  std::vector<std::int32_t> lowest(nodes, std::numeric_limits<std::int32_t>::max()), highest(nodes, 0);
  for (std::int32_t e = 0; e < all.element_count(); ++e)
    for (const std::int32_t node : all.find_nodes(e)) {
      if (node < 0) continue;
      const std::size_t n = node;
      lowest[n] = std::min(lowest[n], part[e]);
      highest[n] = std::max(highest[n], part[e]);
    }
  std::map<std::pair<std::int32_t, std::int32_t>, std::pair<std::int64_t, std::int64_t>> seams;  // number of nodes, number seen
  for (std::size_t n = 0; n < nodes; ++n) ++seams[{lowest[n], highest[n]}].first;
  for (std::size_t n = 0; n < nodes; ++n) {
    auto& [count, seen] = seams[{lowest[n], highest[n]}];
    if (2 * seen++ >= count) lowest[n] = highest[n];
  }
  return lowest;
}

ElementShape make_shape_of(const Assembly& assembly, std::int32_t element) {
  const auto nodes = assembly.find_nodes(element);
  std::array<Vec3, 10> x{};
  for (std::size_t a = 0; a < nodes.size(); ++a) x[a] = assembly.nodes_m[nodes[a]];
  ElementShape shape;
  if (!make_shape(assembly.find_kind(element), std::span(x.data(), nodes.size()), shape))
    throw InputError(assembly.describe(element) + ", is inside out or folded over; repair the mesh");
  return shape;
}

}  // namespace

Domain::Domain(const comm::Communicator& comm, std::shared_ptr<const Assembly> assembly, const Loops& loops)
    : comm_(comm), assembly_(std::move(assembly)), loops_(&loops) {
  const std::vector<std::int32_t> part = cut(comm_, *assembly_);
  comm::Halo halo;
  comm_.agree([&] {
    const Assembly& all = *assembly_;
    const std::int32_t rank = comm_.rank();
    const std::vector<std::int32_t> owner = find_owners(all, part);
    std::vector<std::tuple<std::int32_t, std::int32_t>> others;  // owner, number: sorted by neighbour
    std::vector<char> is_wanted(owner.size(), 0);
    for (std::int32_t e = 0; e < all.element_count(); ++e) {
      const auto nodes = all.find_nodes(e);
      const auto is_own = [&](std::int32_t node) { return node >= 0 && owner[node] == rank; };
      if (std::none_of(nodes.begin(), nodes.end(), is_own)) continue;
      element_.push_back(e);
      // Reported by the owner of its first node.
      is_reported_.push_back(is_own(nodes[0]) ? 1 : 0);
      for (const std::int32_t node : nodes)
        if (node >= 0 && !is_own(node) && !std::exchange(is_wanted[node], 1)) others.emplace_back(owner[node], node);
    }
    std::sort(others.begin(), others.end());
    for (std::int32_t node = 0; node < all.node_count(); ++node)
      if (owner[node] == rank) number_.push_back(node);
    own_ = static_cast<std::int32_t>(number_.size());
    for (const auto& [of, node] : others) {
      halo.number.push_back(node);
      halo.owner.push_back(of);
      halo.place.push_back(static_cast<std::int32_t>(number_.size()));
      number_.push_back(node);
    }
    place_.assign(owner.size(), -1);
    for (std::size_t i = 0; i < number_.size(); ++i) {
      place_[number_[i]] = static_cast<std::int32_t>(i);
      rest_m_.push_back(all.nodes_m[number_[i]]);
      body_.push_back(all.find_body_of_node(number_[i]));
      is_point_.push_back(all.is_point(number_[i]) ? 1 : 0);
      const Assembly::Body& body = all.bodies[body_.back()];
      const std::int32_t in_body = number_[i] - body.first_node;
      is_angle_.push_back(body.is_sheet && in_body >= body.sheet.vertices && in_body < body.sheet.vertices + body.sheet.edges ? 1 : 0);
      if (body.is_sheet) of_sheets_.push_back(static_cast<std::int32_t>(i));
    }
    make_elements();
  });
  halo_ = comm::HaloExchange(comm_, halo, [&](std::int32_t number) { return find_place(number); });
  comm_.agree([&] { halo_.reserve(sizeof(Quad)); });
  check_slivers();
}

void Domain::make_elements() {
  const Assembly& all = *assembly_;
  ElementNodes elements;  // without the missing neighbours of a sheet's rim triangles
  std::vector<Law> laws;
  for (const Assembly::Body& body : all.bodies) laws.push_back(body.law);
  mass_kg_.assign(own_, 0.0);
  for (const std::int32_t e : element_) {
    std::vector<std::int32_t> places;
    for (const std::int32_t node : all.find_nodes(e))
      if (node >= 0) places.push_back(find_place(node));
    elements.add(places.data(), places.size());
    if (all.find_kind(e) == Kind::kSheet) continue;
    const ElementShape shape = make_shape_of(all, e);
    for (std::size_t a = 0; a < places.size(); ++a)
      if (places[a] < own_) mass_kg_[places[a]] += laws[all.find_body(e)].density_kg_m3 * shape.lumped_m3[a];
  }
  for (const Assembly::Body& body : all.bodies) {
    if (!body.is_sheet) continue;
    const std::vector<double> mass = calc_masses(body.sheet, body.sheet_law);
    for (std::size_t n = 0; n < mass.size(); ++n) {
      const std::int32_t place = find_place(body.first_node + static_cast<std::int32_t>(n));
      if (place >= 0 && place < own_) mass_kg_[place] = mass[n];
    }
  }
  if (!of_sheets_.empty()) x_.resize(number_.size());
  const std::int32_t no_entry = own_;
  plan_ = plan_writes(elements, own_, own_ + 1, no_entry);
  const auto find_writes = [&](std::int32_t i) { return plan_.writes.begin() + elements.begin[i]; };
  const auto pick = [&](const std::vector<std::int32_t>& list) {
    Part part;
    std::vector<SolidElement> solids;
    struct Triangles {
      std::vector<std::int32_t> list, which;
      std::vector<std::array<std::int32_t, 9>> read, write;
    };
    std::vector<Triangles> sheets(all.bodies.size());
    for (const std::int32_t i : list) {
      const std::int32_t e = element_[i], body = all.find_body(e);
      const auto nodes = all.find_nodes(e);
      auto write = find_writes(i);
      if (all.find_kind(e) != Kind::kSheet) {
        SolidElement solid{all.find_kind(e), body, {}, {}};
        for (std::size_t a = 0; a < nodes.size(); ++a) solid.read[a] = find_place(nodes[a]);
        std::copy_n(write, nodes.size(), solid.write.begin());
        solids.push_back(solid);
        part.list.push_back(i);
        continue;
      }
      Triangles& triangles = sheets[body];
      triangles.list.push_back(i);
      triangles.which.push_back(e - all.bodies[body].first_element);
      std::array<std::int32_t, 9> from{}, to{};
      for (std::size_t a = 0; a < 9; ++a) {
        from[a] = nodes[a] < 0 ? -1 : find_place(nodes[a]);
        to[a] = nodes[a] < 0 ? no_entry : *write++;
      }
      triangles.read.push_back(from);
      triangles.write.push_back(to);
    }
    part.solids = Solids(solids, laws, rest_m_, no_entry, *loops_);
    for (std::size_t b = 0; b < sheets.size(); ++b)
      if (!sheets[b].which.empty())
        part.sheets.push_back({std::move(sheets[b].list), Sheets(all.bodies[b].sheet, sheets[b].which, all.bodies[b].sheet_law,
                                                                 sheets[b].read, sheets[b].write, no_entry)});
    return part;
  };
  inner_ = pick(plan_.inner);
  outer_ = pick(plan_.outer);
}

void Domain::set_places(const Quad* u, std::int32_t begin, std::int32_t end) const {
  const auto from = std::lower_bound(of_sheets_.begin(), of_sheets_.end(), begin), to = std::lower_bound(from, of_sheets_.end(), end);
  for (auto at = from; at != to; ++at) {
    const std::size_t i = *at;
    const bool is_angle = is_angle_[i] != 0;
    x_[i] = is_angle ? u[i] : Quad{rest_m_[i][0] + u[i].x, rest_m_[i][1] + u[i].y, rest_m_[i][2] + u[i].z, 0.0};
  }
}

void Domain::check_slivers() const {
  struct Own {
    std::int32_t body, element;
    double step_s;
  };
  std::vector<Own> steps = comm_.all_gather([&] {
    std::vector<Own> own;
    for (std::size_t i = 0; i < element_.size(); ++i) {
      if (is_reported_[i] == 0) continue;
      const std::int32_t body = assembly_->find_body(element_[i]);
      if (assembly_->bodies[body].is_sheet) {
        own.push_back({body, element_[i], calc_triangle_step(*assembly_, element_[i])});
        continue;
      }
      own.push_back({body, element_[i], 2.0 / calc_omega(make_shape_of(*assembly_, element_[i]), assembly_->bodies[body].law)});
    }
    return own;
  });
  comm_.agree([&] {
    std::sort(steps.begin(), steps.end(),
              [](const Own& a, const Own& b) { return std::tie(a.body, a.step_s, a.element) < std::tie(b.body, b.step_s, b.element); });
    for (std::size_t first = 0; first < steps.size();) {
      std::size_t last = first;
      while (last < steps.size() && steps[last].body == steps[first].body) ++last;
      const Own& least = steps[first];
      const double median = steps[first + (last - first) / 2].step_s;
      if (least.step_s < kSliverShare * median)
        throw InputError(fmt::format(
            "{}, is a sliver: it allows a step of {:.3g} s only, and half of the body's elements {:.3g} s or more; it would slow down the "
            "whole run {:.1f} times. Make a mesh of better quality there",
            assembly_->describe(least.element), least.step_s, median, median / least.step_s));
      first = last;
    }
  });
}

void Domain::set_inner_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f) {
  std::fill_n(f, force_count(), Quad{});
  inner_.solids.add_forces(weights, u, v, f);
  if (of_sheets_.empty()) return;
  set_places(u, 0, own_);
  for (SheetRun& run : inner_.sheets) run.sheets.add_forces(weights, x_.data(), v, f);
}

void Domain::add_outer_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f) {
  outer_.solids.add_forces(weights, u, v, f);
  if (!of_sheets_.empty()) {
    set_places(u, own_, node_count());
    for (SheetRun& run : outer_.sheets) run.sheets.add_forces(weights, x_.data(), v, f);
  }
  plan_.gather(f);
}

void Domain::set_elastic_forces(const Quad* u, Quad* f) const {
  std::fill_n(f, force_count(), Quad{});
  set_places(u, 0, node_count());
  for (const Part* part : {&inner_, &outer_}) {
    part->solids.add_elastic_forces(u, f);
    for (const SheetRun& run : part->sheets) run.sheets.add_elastic_forces(x_.data(), f);
  }
  plan_.gather(f);
}

Domain::State Domain::calc_state(const Quad* u) const {
  State state;
  std::vector<double> energy, least;
  const auto report = [&](std::int32_t i, double energy_j, double least_det) {
    const std::size_t at = i;
    if (is_reported_[at] == 0) return;
    state.element.push_back(element_[at]);
    state.energy_j.push_back(energy_j);
    state.least_det.push_back(least_det);
  };
  set_places(u, 0, node_count());
  for (const Part* part : {&inner_, &outer_}) {
    part->solids.calc_state(u, energy, least);
    for (std::size_t i = 0; i < part->list.size(); ++i) report(part->list[i], energy[i], least[i]);
    for (const SheetRun& run : part->sheets)
      for (std::size_t i = 0; i < run.list.size(); ++i) {
        // Sheets have no inversion; their energy detects non-finite values.
        const double of_triangle = run.sheets.calc_energy(i, x_.data());
        report(run.list[i], of_triangle, std::isfinite(of_triangle) ? 1.0 : std::numeric_limits<double>::quiet_NaN());
      }
  }
  return state;
}

std::vector<double> Domain::list_spent() const {
  std::vector<double> spent;
  for (const Part* part : {&inner_, &outer_}) {
    const std::vector<double> all = part->solids.list_spent();
    for (std::size_t i = 0; i < part->list.size(); ++i)
      if (is_reported_[part->list[i]] != 0) spent.push_back(all[i]);
    for (const SheetRun& run : part->sheets)
      for (std::size_t i = 0; i < run.list.size(); ++i)
        if (is_reported_[run.list[i]] != 0) spent.push_back(run.sheets.get_spent(i));
  }
  return spent;
}

void Domain::forget_spent() {
  for (Part* part : {&inner_, &outer_}) {
    part->solids.forget_spent();
    for (SheetRun& run : part->sheets) run.sheets.forget_spent();
  }
}

void Domain::save_elements(std::vector<std::int32_t>& element, std::vector<double>& state) const {
  static_assert(Sheets::kStateWidth <= Solids::kStateWidth);
  const auto append = [&](std::int32_t i, const double* values, std::size_t count) {
    const std::size_t at = i;
    if (is_reported_[at] == 0) return;
    element.push_back(element_[at]);
    state.insert(state.end(), values, values + count);
    state.resize(element.size() * Solids::kStateWidth, 0.0);
  };
  for (const Part* part : {&inner_, &outer_}) {
    std::vector<double> all;
    part->solids.save_state(all);
    for (std::size_t i = 0; i < part->list.size(); ++i) append(part->list[i], all.data() + i * Solids::kStateWidth, Solids::kStateWidth);
    for (const SheetRun& run : part->sheets)
      for (std::size_t i = 0; i < run.list.size(); ++i) {
        std::array<double, Sheets::kStateWidth> one{};
        run.sheets.save_state(i, one.data());
        append(run.list[i], one.data(), one.size());
      }
  }
}

void Domain::load_elements(std::span<const double> state_of_all) {
  const auto find = [&](std::int32_t i) {
    return state_of_all.subspan(static_cast<std::size_t>(element_[i]) * Solids::kStateWidth, Solids::kStateWidth);
  };
  for (Part* part : {&inner_, &outer_}) {
    std::vector<double> own;
    for (const std::int32_t i : part->list) {
      const auto of = find(i);
      own.insert(own.end(), of.begin(), of.end());
    }
    part->solids.load_state(own);
    for (SheetRun& run : part->sheets)
      for (std::size_t i = 0; i < run.list.size(); ++i) run.sheets.load_state(i, find(run.list[i]).data());
  }
}

}  // namespace carillon::transient
