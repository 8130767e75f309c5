#include "precompute/run/io/fingerprint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "runtime/base/error.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::io {
namespace {

using tests::get_rank;

job::JobSpec make_job(const std::string& more, const std::string& bank = "a.hdf") {
  return job::parse_job(R"({"mesh": "a.msh", "bank": ")" + bank +
                            R"(", "material": {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850,
                               "damping": {"rayleigh": {}}})" +
                            more + "}",
                        "/jobs/a.json");
}

TEST(JobFingerprint, is_of_what_is_computed_and_not_of_where_it_lies) {
  const Fingerprint plain = find_job_fingerprint(make_job(""), {});
  EXPECT_EQ(find_job_fingerprint(make_job("", "elsewhere/b.hdf"), {}), plain);
  EXPECT_NE(find_job_fingerprint(make_job(R"(, "band_hz": [20, 19999])"), {}), plain);
  EXPECT_NE(find_job_fingerprint(make_job(R"(, "element": "T4")"), {}), plain);
  EXPECT_NE(find_job_fingerprint(make_job(""), {"-mumps_ordering", "amd"}), plain);
}

TEST(Setting, is_read_as_it_was_written_and_never_from_less) {
  Setting setting;
  setting.element = job::Element::T4;
  setting.tolerance = 1e-9;
  setting.edge_m = 0.003;
  setting.refinements = 2;
  setting.layers = 3;
  setting.expected_hz = 1234.5;
  eigen::NumberWriter writer;
  write_setting(writer, setting);
  eigen::NumberReader reader(writer.bytes);
  const Setting back = read_setting(reader);
  reader.end();
  EXPECT_EQ(back.element, setting.element);
  EXPECT_EQ(back.tolerance, setting.tolerance);
  EXPECT_EQ(back.edge_m, setting.edge_m);
  EXPECT_FALSE(back.nodes);
  EXPECT_EQ(back.refinements, 2);
  EXPECT_EQ(back.layers, 3);
  EXPECT_EQ(back.expected_hz, 1234.5);
  for (std::size_t size = 0; size < writer.bytes.size(); ++size) {
    const std::string cut = writer.bytes.substr(0, size);
    eigen::NumberReader less(cut);
    EXPECT_THROW(read_setting(less), InputError) << size;
  }
  setting.tolerance = 2;
  eigen::NumberWriter wrong;
  write_setting(wrong, setting);
  eigen::NumberReader refused(wrong.bytes);
  EXPECT_THROW(read_setting(refused), InputError);
}

/// A chain of tetrahedra over ten nodes; all on rank 0, or distributed over the ranks.
mesh::LocalMesh make_chain(bool is_dealt) {
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (!is_dealt) ranks = 1;
  const int rank = is_dealt ? get_rank() : 0;
  mesh::LocalMesh mesh;
  for (int pass = 0; pass < 2; ++pass) {  // own nodes first, then the others as halo
    for (std::int32_t node = 0; node < 10; ++node) {
      if ((node % ranks == rank) != (pass == 0)) continue;
      mesh.node_in_mesh.push_back(node);
      mesh.nodes_m.push_back({0.1 * node, std::sin(node), 1.0 / (1 + node)});
      mesh.row.push_back(node == 4 ? -1 : node);
      mesh.owned_nodes += pass == 0 ? 1 : 0;
    }
  }
  const auto find = [&](std::int32_t node) {
    for (std::size_t i = 0; i < mesh.node_in_mesh.size(); ++i)
      if (mesh.node_in_mesh[i] == node) return static_cast<std::int32_t>(i);
    return -1;
  };
  for (std::int32_t e = 0; e < 7; ++e) {
    if (e % ranks != rank) continue;
    mesh.tet_in_mesh.push_back(e);
    for (std::int32_t k = 0; k < 4; ++k) mesh.tets.push_back(find(e + k));
  }
  return mesh;
}

TEST(SystemFingerprint, is_the_same_for_every_partition_and_differs_for_every_other_mesh) {
  const Fingerprint job = base::calc_sha256("a job");
  const auto find = [&](const mesh::LocalMesh& mesh, const Setting& setting = {}) {
    return find_system_fingerprint(MPI_COMM_WORLD, job, setting, mesh);
  };
  const mesh::LocalMesh mesh = make_chain(true);
  const Fingerprint whole = find_system_fingerprint(MPI_COMM_SELF, job, {}, make_chain(false));
  EXPECT_EQ(find(mesh), whole);
  mesh::LocalMesh moved = mesh, fixed = mesh, other = mesh;
  if (get_rank() == 0) {
    moved.nodes_m[0][1] = std::nextafter(moved.nodes_m[0][1], 1);
    fixed.row[0] = -1;
    std::swap(other.tets[0], other.tets[1]);
  }
  EXPECT_NE(find(moved), whole);
  EXPECT_NE(find(fixed), whole);
  EXPECT_NE(find(other), whole);
  Setting finer;
  finer.tolerance = 1e-10;
  EXPECT_NE(find(mesh, finer), whole);
}

}  // namespace
}  // namespace carillon::io
