// Method: SHA-256 for data on one rank or equal on all. Nodes and elements are distributed: each is hashed to 64 bits with its number in
//   the mesh, and the sum is independent of the partition.
// Source: Bellare, Micciancio, A new paradigm for collision-free hashing, EUROCRYPT 1997 (sums). FIPS 180-4 (SHA-256).
// Deviations: the sums guard against mistakes and damage, not against deliberate collisions.
#include "precompute/run/io/fingerprint.hpp"

#include <bit>

#include "precompute/petsc/noise.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/version.hpp"

namespace carillon::io {

void Mixer::add(double value) { add(std::bit_cast<std::uint64_t>(value)); }

std::uint64_t Mixer::get() const { return petsc::scramble(state_); }

std::string find_program_version() { return std::string(base::get_number()) + " (" + base::get_git_id() + ")"; }

void write_setting(eigen::NumberWriter& to, const Setting& setting) {
  to.add(static_cast<std::int64_t>(setting.element));
  to.add(setting.tolerance);
  to.add(setting.nodes.value_or(0));
  to.add(setting.edge_m.value_or(0));
  to.add(static_cast<std::int64_t>(setting.refinements));
  to.add(static_cast<std::int64_t>(setting.layers));
  to.add(static_cast<std::int64_t>(setting.extrudes));
  to.add(setting.expected_hz);
}

Setting read_setting(eigen::NumberReader& from) {
  Setting setting;
  setting.element = from.get_count(0, 1) == 0 ? job::Element::T4 : job::Element::T10;
  setting.tolerance = from.get_double();
  const std::int64_t nodes = from.get_count(0, std::int64_t{1} << 40);
  const double edge_m = from.get_double();
  if (nodes > 0) setting.nodes = nodes;
  if (edge_m > 0) setting.edge_m = edge_m;
  setting.refinements = static_cast<int>(from.get_count(0, 100));
  setting.layers = static_cast<int>(from.get_count(1, 100));
  setting.extrudes = from.get_count(0, 1) == 1;
  setting.expected_hz = from.get_double();
  const bool is_known = setting.tolerance > 0 && setting.tolerance < 1 && setting.expected_hz >= 0;
  if (!is_known) throw InputError("a number in it is out of range");
  return setting;
}

Fingerprint find_job_fingerprint(const job::JobSpec& job, const std::vector<std::string>& solver_options) {
  base::Json root = base::Json::parse(job::resolved_json(job, "/", "")).value();
  for (const char* key : {"mesh", "bank", "resources"}) root.erase(key);
  if (root.has("body")) root["body"].erase("surface");
  std::string text = find_program_version() + "\n" + root.sorted_text({.indentation = "\t", .breaks_arrays = true});
  for (const std::string& word : solver_options) text += "\n" + word;
  return base::calc_sha256(text);
}

Fingerprint find_system_fingerprint(const comm::Communicator& comm, const Fingerprint& job, const Setting& setting,
                                    const mesh::LocalMesh& local) {
  std::array<std::uint64_t, 4> sums{};  // of nodes, of elements; counts
  for (std::int32_t i = 0; i < local.owned_nodes; ++i) {
    const std::size_t at = i;
    Mixer node(static_cast<std::uint64_t>(local.node_in_mesh[at]));
    for (const double x : local.nodes_m[at]) node.add(x);
    node.add(static_cast<std::uint64_t>(local.row[at] < 0));
    sums[0] += node.get();
  }
  const std::size_t width = local.nodes_per_tet();
  for (std::size_t e = 0; e < local.tet_in_mesh.size(); ++e) {
    Mixer tet(static_cast<std::uint64_t>(local.tet_in_mesh[e]));
    for (std::size_t k = 0; k < width; ++k) tet.add(static_cast<std::uint64_t>(local.node_in_mesh[local.tets[e * width + k]]));
    if (!local.region.empty()) tet.add(static_cast<std::uint64_t>(local.region[e]));
    sums[1] += tet.get();
  }
  sums[2] = static_cast<std::uint64_t>(local.owned_nodes);
  sums[3] = local.tet_in_mesh.size();
  comm.sum(sums);
  eigen::NumberWriter all;
  all.bytes.assign(reinterpret_cast<const char*>(job.data()), job.size());
  for (const std::uint64_t sum : sums) all.add(static_cast<std::int64_t>(sum));
  write_setting(all, setting);
  return base::calc_sha256(all.bytes);
}

}  // namespace carillon::io
