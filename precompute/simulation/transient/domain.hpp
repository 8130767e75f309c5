// One rank's part of the bodies: own nodes and halo, all elements that touch an own node, forces on own nodes.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/halo_exchange.hpp"
#include "precompute/simulation/transient/assembly.hpp"
#include "precompute/simulation/transient/quad.hpp"
#include "precompute/simulation/transient/sheets.hpp"
#include "precompute/simulation/transient/solids.hpp"
#include "precompute/simulation/transient/writes.hpp"

namespace carillon::transient {

/// Partitioned by METIS over the elements, or by inertial bisection with sheets. A node belongs to a rank that has an element with it. Own
/// nodes first, by ascending number, then the halo. Forces on own nodes are bit-identical on any number of ranks: every rank computes all
/// elements that touch one, and a node's sum runs over its elements in ascending order (WritePlan).
class Domain {
 public:
  /// Collective. Throws on every rank: InputError for fewer elements than ranks, and for a sliver, an element whose critical step is under
  /// a fifth of its body's median (it would limit the step of all); the message gives the element and its step.
  Domain(const comm::Communicator& comm, std::shared_ptr<const Assembly> assembly, const Loops& loops = find_loops());

  const comm::Communicator& get_comm() const { return comm_; }
  const Assembly& get_assembly() const { return *assembly_; }
  const Loops& get_loops() const { return *loops_; }
  std::int32_t own_count() const { return own_; }
  std::int32_t node_count() const { return static_cast<std::int32_t>(number_.size()); }      // own and halo: length of u and v
  std::int32_t force_count() const { return plan_.last_slot; }                               // length of f: own, one spare, slots
  std::int64_t element_count() const { return static_cast<std::int64_t>(element_.size()); }  // computed by this rank
  std::int32_t find_number(std::int32_t place) const { return number_[place]; }
  std::int32_t find_body(std::int32_t place) const { return body_[place]; }
  /// Index of an assembly node in u and v; -1 if not on this rank; own if under own_count().
  std::int32_t find_place(std::int32_t number) const { return place_[number]; }
  bool is_point(std::int32_t place) const { return is_point_[place] != 0; }  // Assembly::is_point
  const std::vector<Vec3>& get_rest_m() const { return rest_m_; }            // (node_count)
  const std::vector<double>& get_masses_kg() const { return mass_kg_; }      // (own_count) lumped

  /// Sends own values to other ranks' halos, and fills the halo of `values` (node_count). Inner elements may be computed between the two
  /// calls. Collective; does not allocate.
  void begin_halo(Quad* values) { halo_.begin_copy_to_halo(values, 1); }
  void end_halo(Quad* values) { halo_.end_copy_to_halo(values, 1); }
  void copy_to_halo(Quad* values) { halo_.copy_to_halo(values, 1); }

  /// f (force_count) = element forces [N], valid on own nodes after the second call. The first call handles elements without halo nodes,
  /// during communication. Keeps damping state (Solids::add_forces). Local.
  void set_inner_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f);
  void add_outer_forces(const StepWeights& weights, const Quad* u, const Quad* v, Quad* f);
  /// The same without damping and state. Local; u has its halo.
  void set_elastic_forces(const Quad* u, Quad* f) const;

  /// Elements reported by this rank, each on one rank.
  struct State {
    std::vector<std::int32_t> element;
    std::vector<double> energy_j, least_det;
  };
  State calc_state(const Quad* u) const;  // local
  /// Damping work since the last forget_spent() of the reported elements [J]. Local.
  std::vector<double> list_spent() const;
  void forget_spent();

  /// Damping state by element number: of reported elements (all, over the ranks), and of all elements of this rank. Local.
  void save_elements(std::vector<std::int32_t>& element, std::vector<double>& state) const;
  void load_elements(std::span<const double> state_of_all);

 private:
  /// Triangles of one sheet among the inner or the outer elements.
  struct SheetRun {
    std::vector<std::int32_t> list;  // into element_
    Sheets sheets;
  };
  /// Elements of one phase: solids first, then sheets.
  struct Part {
    std::vector<std::int32_t> list;  // of the solids, into element_
    Solids solids;
    std::vector<SheetRun> sheets;
  };
  void make_elements();
  /// Positions of a sheet's nodes among `begin` <= index < `end`, from displacements.
  void set_places(const Quad* u, std::int32_t begin, std::int32_t end) const;
  void check_slivers() const;

  comm::Communicator comm_;
  std::shared_ptr<const Assembly> assembly_;
  const Loops* loops_;
  std::int32_t own_ = 0;
  std::vector<std::int32_t> number_, body_;  // (own and halo)
  std::vector<std::int32_t> place_;          // (nodes of the assembly)
  std::vector<Vec3> rest_m_;
  std::vector<double> mass_kg_;
  std::vector<std::int32_t> element_;  // ascending
  std::vector<char> is_reported_;      // (element_)
  WritePlan plan_;
  Part inner_, outer_;
  std::vector<char> is_point_, is_angle_;  // (node_count)
  std::vector<std::int32_t> of_sheets_;    // indices of sheet nodes, ascending
  mutable std::vector<Quad> x_;            // (node_count) of sheets: positions, or angles
  comm::HaloExchange halo_;
};

}  // namespace carillon::transient
