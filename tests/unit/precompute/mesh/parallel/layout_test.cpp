// Layout of valid, unusual and damaged VTKHDF files.
#include "precompute/mesh/parallel/layout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <functional>
#include <random>

#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesh/parallel/write_vtkhdf.hpp"

namespace carillon::parallel_mesh {
namespace {

using testing::HasSubstr;

class File {
 public:
  File() : path_(std::filesystem::temp_directory_path() / ("carillon-layout-" + std::to_string(getpid()) + ".vtkhdf")) {}
  ~File() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }
  std::string read() const {
    std::ifstream in(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

 private:
  std::filesystem::path path_;
};

std::string find_refusal(const std::filesystem::path& file) {
  return tests::catch_message<InputError>([&] { find_layout(file); });
}

TEST(Layout, array_offsets) {
  const File file;
  const auto box = tests::make_box({3, 2, 1}, {1, 2, 3});
  tests::write_vtkhdf(file.path(), box, {.point_data = {{"clamp", std::vector<std::int32_t>(box.nodes_m.size(), 7)}}});
  const Layout layout = find_layout(file.path());
  EXPECT_EQ(layout.points.rows, static_cast<std::int64_t>(box.nodes_m.size()));
  EXPECT_EQ(layout.points.columns, 3);
  EXPECT_EQ(layout.types.rows, box.tet_count());
  EXPECT_EQ(layout.types.bytes, 1);
  EXPECT_FALSE(layout.types.is_signed);
  ASSERT_EQ(layout.cell_data.size(), 1u);
  EXPECT_TRUE(layout.cell_data[0].is_big_endian);
  ASSERT_EQ(layout.point_data.size(), 1u);
  EXPECT_EQ(layout.point_data[0].name, "clamp");
  const std::string bytes = file.read();
  double x = 0;
  std::memcpy(&x, bytes.data() + layout.points.offset + 8, 8);
  EXPECT_EQ(x, box.nodes_m[0][1]);
  std::int64_t node = 0;
  std::memcpy(&node, bytes.data() + layout.connectivity.offset + 8 * 5, 8);
  EXPECT_EQ(node, box.tets[5]);
}

TEST(Layout, unsupported_layouts) {
  const File file;
  const auto box = tests::make_box({1, 1, 1}, {1, 1, 1});
  const auto refusal = [&](const tests::VtkHdfOptions& options) {
    tests::write_vtkhdf(file.path(), box, options);
    return find_refusal(file.path());
  };
  EXPECT_THAT(refusal({.is_chunked = true}), HasSubstr("h5repack -l CONTI"));
  EXPECT_THAT(refusal({.type = "ImageData"}), HasSubstr("only UnstructuredGrid"));
  EXPECT_THAT(refusal({.pieces = 2}), HasSubstr("in 2 pieces"));
  const hid_t empty = H5Fcreate(file.path().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(empty);
  EXPECT_THAT(find_refusal(file.path()), HasSubstr("VTKHDF is missing"));
}

TEST(Layout, external_links) {
  const File file, other;
  const auto box = tests::make_box({1, 1, 1}, {1, 1, 1});
  tests::write_vtkhdf(file.path(), box);
  const hid_t open = H5Fopen(file.path().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(open, "/VTKHDF/Points", H5P_DEFAULT);
  H5Lcreate_external("/etc/passwd", "/Points", open, "/VTKHDF/Points", H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(open);
  EXPECT_THAT(find_refusal(file.path()), HasSubstr("Points is a link"));
}

// HDF5 crashes on some of these, in the child only. Accepted arrays lie inside the file.
TEST(Layout, damaged_files) {
  const File file;
  tests::write_vtkhdf(file.path(), tests::make_box({1, 1, 1}, {1, 1, 1}));
  const std::string good = file.read();
  std::mt19937 random(11);
  int refused = 0;
  const auto try_bytes = [&](const std::string& bytes) {
    file.write(bytes);
    try {
      const Layout layout = find_layout(file.path());
      for (const Array* array : {&layout.points, &layout.connectivity, &layout.offsets, &layout.types})
        EXPECT_LE(array->offset + array->rows * array->columns * array->bytes, static_cast<std::int64_t>(bytes.size()));
    } catch (const InputError& error) {
      ++refused;
      EXPECT_THAT(error.what(), HasSubstr(file.path().string()));
    }
  };
  for (std::size_t length = 8; length < good.size(); length += good.size() / 40) try_bytes(good.substr(0, length));
  const int truncated = refused;
  for (int round = 0; round < 200; ++round) {
    std::string bad = good;
    const int spots = 1 + static_cast<int>(random() % 8);
    for (int k = 0; k < spots; ++k) bad[random() % bad.size()] = static_cast<char>(random());
    try_bytes(bad);
  }
  EXPECT_GE(truncated, 38);
  EXPECT_GT(refused, truncated + 20);
}

}  // namespace
}  // namespace carillon::parallel_mesh
