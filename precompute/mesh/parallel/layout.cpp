// Method: carillon-vtkhdf opens the file with HDF5 in a process of its own and prints the location of each array. The arrays are read by
//   offset, without HDF5; every offset is checked here against the file length.
// Source: VTK file formats, "VTKHDF", version 1.0.
#include "precompute/mesh/parallel/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <sstream>

#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {
namespace {

constexpr std::size_t kMaxText = 1 << 20;
constexpr double kPatienceS = 30;

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw InputError(fmt::format("{}: {}", file.string(), what));
}

/// Output of carillon-vtkhdf.
std::string describe_file(const std::filesystem::path& file) {
  const base::Finished finished = base::run(
      {.words = {base::find_helper("carillon-vtkhdf").string(), std::filesystem::absolute(file).string()}, .output = base::kCapture},
      {.patience_s = kPatienceS, .max_bytes = kMaxText});
  if (finished.was_slow || finished.was_long || finished.exit_code != 0 || finished.output.empty())
    refuse(file, "its HDF5 structure is damaged (HDF5 fails on it); write it again");
  return finished.output;
}

void check_array(const std::filesystem::path& file, std::int64_t file_bytes, const Array& array) {
  const bool is_inside = array.offset >= 0 && array.rows >= 0 && array.columns >= 0 && array.columns <= 16 && array.bytes > 0 &&
                         array.bytes <= 8 && array.offset <= file_bytes &&
                         array.rows <= (file_bytes - array.offset) / std::max<std::int64_t>(array.columns * array.bytes, 1);
  if (!is_inside)
    refuse(file, fmt::format("array '{}' reaches beyond the end of the file ({} bytes); write it again", array.name, file_bytes));
}

Array parse_array(const std::filesystem::path& file, std::istringstream& line) {
  Array array;
  std::string hex;
  int is_floating = 0, is_signed = 0, is_big_endian = 0;
  line >> hex >> array.offset >> array.rows >> array.columns >> array.bytes >> is_floating >> is_signed >> is_big_endian;
  if (!line) refuse(file, "its HDF5 structure is damaged; write it again");
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) array.name += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  array.is_floating = is_floating != 0;
  array.is_signed = is_signed != 0;
  array.is_big_endian = is_big_endian != 0;
  return array;
}

void check_shapes(const std::filesystem::path& file, const Layout& layout, const std::array<std::int64_t, 3>& counts) {
  if (!layout.points.is_floating || layout.points.columns != 3) refuse(file, "Points is no (N, 3) array of floating-point numbers");
  for (const Array* array : {&layout.connectivity, &layout.offsets, &layout.types})
    if (array->is_floating || array->columns != 1) refuse(file, array->name + " is no plain array of integers");
  const std::int64_t cells = layout.types.rows;
  if (counts[0] != layout.points.rows || counts[1] != cells || counts[2] != layout.connectivity.rows)
    refuse(file, fmt::format("NumberOfPoints, NumberOfCells and NumberOfConnectivityIds say {}, {} and {}, but Points, Types and "
                             "Connectivity have {}, {} and {} entries; write it again",
                             counts[0], counts[1], counts[2], layout.points.rows, cells, layout.connectivity.rows));
  if (layout.offsets.rows != cells + 1)
    refuse(file, fmt::format("Offsets has {} entries for {} cells; it needs one more than cells", layout.offsets.rows, cells));
  if (layout.points.rows == 0) refuse(file, "the mesh has no nodes");
  if (cells == 0) refuse(file, "the mesh has no tetrahedra; mesh the volume first");
  if (layout.points.rows > INT32_MAX || cells > INT32_MAX)
    refuse(file, fmt::format("{} nodes and {} cells; 32-bit numbers end at 2147483647: take a coarser mesh", layout.points.rows, cells));
}

}  // namespace

Layout find_layout(const std::filesystem::path& file) {
  std::istringstream lines(describe_file(file));
  std::error_code error;
  const auto file_bytes = static_cast<std::int64_t>(std::filesystem::file_size(file, error));
  if (error) throw SystemError(fmt::format("{}: {}", file.string(), error.message()));
  Layout layout;
  std::array<std::int64_t, 3> counts{};
  std::string text;
  bool is_complete = false;
  while (std::getline(lines, text)) {
    std::istringstream line(text);
    std::string word;
    line >> word;
    if (word == "refused") refuse(file, text.substr(8));
    if (word == "end") is_complete = true;
    if (word == "counts") line >> counts[0] >> counts[1] >> counts[2];
    if (word == "points") layout.points = parse_array(file, line);
    if (word == "connectivity") layout.connectivity = parse_array(file, line);
    if (word == "offsets") layout.offsets = parse_array(file, line);
    if (word == "types") layout.types = parse_array(file, line);
    if (word == "point_data") layout.point_data.push_back(parse_array(file, line));
    if (word == "cell_data") layout.cell_data.push_back(parse_array(file, line));
  }
  if (!is_complete) refuse(file, "its HDF5 structure is damaged; write it again");
  for (const Array* array : {&layout.points, &layout.connectivity, &layout.offsets, &layout.types}) check_array(file, file_bytes, *array);
  check_shapes(file, layout, counts);
  const auto keep = [&](std::vector<Array>& arrays, std::int64_t rows) {
    std::erase_if(arrays, [&](const Array& array) { return array.rows != rows || array.columns != 1 || array.is_floating; });
    for (const Array& array : arrays) check_array(file, file_bytes, array);
  };
  keep(layout.point_data, layout.points.rows);
  keep(layout.cell_data, layout.types.rows);
  return layout;
}

}  // namespace carillon::parallel_mesh
