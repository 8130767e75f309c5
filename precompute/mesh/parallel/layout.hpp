// Locations of the arrays of a VTKHDF file. HDF5 runs in a process of its own.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace carillon::parallel_mesh {

/// Location of a contiguous numeric array in the file, row-major.
struct ArrayPlace {
  std::int64_t offset = 0;  // [byte] from the start of the file
  std::int64_t rows = 0;
  std::int64_t columns = 1;
  int bytes = 0;  // per number: 4 or 8 (floating point), 1, 2, 4 or 8 (integers)
  bool is_floating = false;
  bool is_signed = true;
  bool is_big_endian = false;
};

struct Array : ArrayPlace {
  std::string name = {};
};

struct Layout {
  Array points;                   // (N, 3) floating point [m]
  Array connectivity;             // (C) integers
  Array offsets;                  // (E + 1) integers
  Array types;                    // (E) integers
  std::vector<Array> point_data;  // integer arrays (N) of PointData
  std::vector<Array> cell_data;   // integer arrays (E) of CellData
};

/// Reads the layout of a VTKHDF file in a child process, so that a damaged file cannot crash or block this one. Not collective. Throws
/// InputError unless the file is a VTKHDF 1.0 UnstructuredGrid in one piece with contiguous arrays inside the file; SystemError if no child
/// can be started.
Layout find_layout(const std::filesystem::path& file);

}  // namespace carillon::parallel_mesh
