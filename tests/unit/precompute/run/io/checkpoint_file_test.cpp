// Checkpoint file format: round trip on any number of ranks; truncated, altered or foreign files are refused.
#include "precompute/run/io/checkpoint_file.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "precompute/run/io/node_order.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/sha256.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::io {
namespace {

namespace fs = std::filesystem;
using tests::get_rank;

constexpr std::int32_t kNodes = 40, kFixed = 5;  // of the mesh, and one of them
constexpr int kColumns = 19;                     // more than one group of the file

int count_ranks(MPI_Comm comm) {
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  return ranks;
}

/// Nodes distributed over the ranks in another order than the mesh's; `shift` moves one node.
mesh::LocalMesh make_mesh(MPI_Comm comm, double shift = 0) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  mesh::LocalMesh mesh;
  for (std::int32_t i = 0; i < kNodes; ++i) {
    const std::int32_t node = (17 * i + 3) % kNodes;
    if (node == kFixed || i % count_ranks(comm) != rank) continue;
    mesh.node_in_mesh.push_back(node);
    mesh.nodes_m.push_back({0.1 * node, 0.2 * node, node == 7 ? shift : 0.0});
    mesh.row.push_back(node);
    ++mesh.free_nodes;
  }
  mesh.owned_nodes = mesh.free_nodes;
  return mesh;
}

double find_value(std::int32_t node, int direction, int column) { return node + 100.0 * direction + 1e-3 * column; }

std::vector<double> make_columns(const mesh::LocalMesh& mesh, int first, int count) {
  std::vector<double> values;
  for (int j = first; j < first + count; ++j)
    for (std::int32_t i = 0; i < mesh.free_nodes; ++i)
      for (int d = 0; d < 3; ++d) values.push_back(find_value(mesh.node_in_mesh[i], d, j));
  return values;
}

eigen::Columns view(std::vector<double>& values, const mesh::LocalMesh& mesh, int count) {
  return {values.data(), 3 * mesh.free_nodes, 3 * mesh.free_nodes, count};
}

Setting make_setting() {
  Setting setting;
  setting.tolerance = 3e-7;
  setting.nodes = 4000;
  return setting;
}

const Fingerprint kJob = base::calc_sha256("a job"), kSystem = base::calc_sha256("a system");

class CheckpointFileTest : public testing::Test {
 protected:
  CheckpointFileTest() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / ("carillon-" + std::string(test->name()) + "-" + std::to_string(count_ranks(MPI_COMM_WORLD)));
    if (get_rank() == 0) {
      fs::remove_all(folder_);
      fs::create_directories(folder_);
    }
    MPI_Barrier(MPI_COMM_WORLD);
    file_ = folder_ / "state";
  }
  ~CheckpointFileTest() override {
    MPI_Barrier(MPI_COMM_WORLD);
    if (get_rank() == 0) fs::remove_all(folder_);
  }

  CheckpointHost make_host() {
    return {[](const std::string&) {}, [this](const std::string& text) { warning_ = text; }, [] { return false; }, [](bool) {}};
  }
  void save() {
    CheckpointFile file(MPI_COMM_WORLD, file_, 300, kJob, make_host());
    const mesh::LocalMesh mesh = make_mesh(MPI_COMM_WORLD);
    file.begin(make_setting(), kSystem, mesh);
    std::vector<double> some = make_columns(mesh, 0, 3), others = make_columns(mesh, 3, kColumns - 3);
    ASSERT_TRUE(file.get().save("the numbers", {view(some, mesh, 3), view(others, mesh, kColumns - 3)}));
    EXPECT_TRUE(file.was_saved());
    bytes_ = base::read_file(file_, "checkpoint", 1 << 20);
  }
  /// Reason why a file with these bytes is refused; empty: it is accepted. The same on every rank of `comm`.
  std::string open(const std::string& bytes, MPI_Comm comm = MPI_COMM_WORLD, const Fingerprint& job = kJob,
                   const Fingerprint& system = kSystem) {
    if (get_rank() == 0) base::write_file(file_, bytes);
    MPI_Barrier(comm);
    warning_.clear();
    CheckpointFile file(comm, file_, 300, job, make_host());
    file.begin(make_setting(), system, make_mesh(comm));
    const bool is_resumed = !file.get().numbers.empty();
    EXPECT_TRUE(get_rank() != 0 || is_resumed == warning_.empty());
    return is_resumed ? "" : get_rank() == 0 ? warning_ : "refused";
  }

  fs::path folder_, file_;
  std::string bytes_, warning_;
};

void expect_columns(CheckpointFile& file, const mesh::LocalMesh& mesh) {
  ASSERT_EQ(file.get().numbers, "the numbers");
  ASSERT_EQ(file.get().column_count, kColumns);
  for (const auto& [first, count] : {std::pair{0, kColumns}, {15, 2}, {16, 3}}) {
    std::vector<double> values(3 * mesh.free_nodes * count);
    file.get().read(first, view(values, mesh, count));
    EXPECT_EQ(values, make_columns(mesh, first, count));
  }
}

TEST_F(CheckpointFileTest, what_was_saved_is_read_again) {
  save();
  CheckpointFile file(MPI_COMM_WORLD, file_, 300, kJob, make_host());
  ASSERT_NE(file.find_setting(0), nullptr);
  EXPECT_EQ(file.find_setting(0)->tolerance, 3e-7);
  EXPECT_EQ(file.find_setting(0)->nodes, 4000);
  EXPECT_FALSE(file.find_setting(0)->edge_m);
  EXPECT_EQ(file.find_setting(1), nullptr);
  const mesh::LocalMesh mesh = make_mesh(MPI_COMM_WORLD);
  file.begin(make_setting(), kSystem, mesh);
  expect_columns(file, mesh);
  file.end();
  MPI_Barrier(MPI_COMM_WORLD);
  file.remove();
  MPI_Barrier(MPI_COMM_WORLD);
  EXPECT_FALSE(fs::exists(file_));
}

TEST_F(CheckpointFileTest, one_rank_resumes_what_several_saved) {
  save();
  if (get_rank() != 0) return;
  CheckpointFile file(MPI_COMM_SELF, file_, 300, kJob, make_host());
  const mesh::LocalMesh mesh = make_mesh(MPI_COMM_SELF);
  file.begin(make_setting(), kSystem, mesh);
  expect_columns(file, mesh);
}

TEST_F(CheckpointFileTest, every_truncation_is_refused) {
  save();
  EXPECT_EQ(open(bytes_), "");
  for (const std::size_t size : {std::size_t{0}, std::size_t{300}, bytes_.size() - 1}) EXPECT_NE(open(bytes_.substr(0, size)), "") << size;
  if (get_rank() != 0) return;
  EXPECT_TRUE(fs::exists(folder_ / "state.aside"));
  for (std::size_t size = 0; size < bytes_.size(); size += size < 400 ? 1 : 97)
    EXPECT_NE(open(bytes_.substr(0, size), MPI_COMM_SELF), "") << size << " bytes";
  EXPECT_NE(open(bytes_ + "x", MPI_COMM_SELF), "");
}

TEST_F(CheckpointFileTest, every_altered_byte_is_found) {
  save();
  // Header, settings and numbers; then some bytes of the columns. Padding between them is not read.
  const std::size_t text_end = bytes_.find("the numbers") + std::string("the numbers").size();
  const auto alter = [&](std::size_t at, MPI_Comm comm) {
    std::string altered = bytes_;
    altered[at] = static_cast<char>(altered[at] ^ 0x10);
    EXPECT_NE(open(altered, comm), "") << "byte " << at;
  };
  for (const std::size_t at : {std::size_t{170}, text_end - 1, bytes_.size() - 2}) alter(at, MPI_COMM_WORLD);
  if (get_rank() != 0) return;
  for (std::size_t at = 0; at < bytes_.size(); at = at + 1 == text_end ? 4096 : at + (at < text_end ? 1 : 53)) alter(at, MPI_COMM_SELF);
}

TEST_F(CheckpointFileTest, another_job_mesh_or_version_is_refused_by_name) {
  save();
  const auto expect = [&](const std::string& why, const std::string& words) {
    EXPECT_TRUE(get_rank() != 0 || why.find(words) != std::string::npos) << why;
  };
  expect(open(bytes_, MPI_COMM_WORLD, base::calc_sha256("another job")), "it is of another job");
  expect(open(bytes_, MPI_COMM_WORLD, kJob, base::calc_sha256("another system")), "it is of another mesh");
  std::string later = bytes_;
  std::memcpy(later.data() + 96, "99.0.0", 6);  // the version, then its seal at the end of the header of 256 bytes
  std::memset(later.data() + 224, 0, 32);
  const std::size_t text_end = later.find("the numbers") + std::string("the numbers").size();
  const Fingerprint seal = base::calc_sha256(later.substr(0, text_end));
  std::memcpy(later.data() + 224, seal.data(), seal.size());
  expect(open(later), "it was saved by another version, 99.0.0");
}

TEST_F(CheckpointFileTest, a_disk_that_refuses_is_warned_of_and_the_old_file_stays) {
  save();
  CheckpointFile file(MPI_COMM_WORLD, folder_ / "none" / "state", 300, kJob, make_host());
  const mesh::LocalMesh mesh = make_mesh(MPI_COMM_WORLD);
  file.begin(make_setting(), kSystem, mesh);
  std::vector<double> columns = make_columns(mesh, 0, 2);
  EXPECT_FALSE(file.get().save("numbers", {view(columns, mesh, 2)}));
  EXPECT_NE(warning_.find("cannot be saved"), std::string::npos);
  EXPECT_FALSE(file.was_saved());
}

TEST(NodeOrder, records_are_in_the_order_of_the_mesh_on_any_number_of_ranks) {
  const mesh::LocalMesh mesh = make_mesh(MPI_COMM_WORLD);
  NodeOrder order(MPI_COMM_WORLD, mesh);
  EXPECT_EQ(order.all(), kNodes - 1);
  std::vector<double> values = make_columns(mesh, 0, 2);
  NodeOrder::Room room;
  order.make_room(2, room);
  const std::vector<const double*> columns{values.data(), values.data() + 3 * mesh.free_nodes};
  order.to_records(columns, room);
  for (std::int64_t i = 0; i < order.count(); ++i) {
    const std::int64_t place = order.first() + i;
    const auto node = static_cast<std::int32_t>(place < kFixed ? place : place + 1);
    for (int d = 0; d < 3; ++d)
      for (int j = 0; j < 2; ++j) EXPECT_EQ(room.records[6 * i + 2 * d + j], find_value(node, d, j));
  }
  std::vector<double> back(values.size());
  order.from_records(room, view(back, mesh, 2));
  EXPECT_EQ(back, values);
}

}  // namespace
}  // namespace carillon::io
