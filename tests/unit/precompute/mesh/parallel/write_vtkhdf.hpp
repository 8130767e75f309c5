// Writes meshes as VTKHDF files with HDF5, after VTK's format description.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::tests {

struct VtkHdfOptions {
  bool single_precision = false;
  bool is_chunked = false;
  std::string type = "UnstructuredGrid";
  int pieces = 1;
  std::map<std::string, std::vector<std::int32_t>> point_data = {};
};

inline void write_array(hid_t folder, const char* name, hid_t file_type, hid_t memory_type, const void* data, std::vector<hsize_t> extents,
                        bool is_chunked = false) {
  const hid_t space = H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr);
  const hid_t plist = H5Pcreate(H5P_DATASET_CREATE);
  if (is_chunked) H5Pset_chunk(plist, static_cast<int>(extents.size()), extents.data());
  const hid_t set = H5Dcreate2(folder, name, file_type, space, H5P_DEFAULT, plist, H5P_DEFAULT);
  H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data);
  H5Dclose(set);
  H5Pclose(plist);
  H5Sclose(space);
}

inline void write_vtkhdf(const std::filesystem::path& file, const mesh::TetMesh& mesh, const VtkHdfOptions& options = {}) {
  const hid_t out = H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t root = H5Gcreate2(out, "VTKHDF", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t text = H5Tcopy(H5T_C_S1), scalar = H5Screate(H5S_SCALAR);
  H5Tset_size(text, options.type.size());
  const hid_t type = H5Acreate2(root, "Type", text, scalar, H5P_DEFAULT, H5P_DEFAULT);
  H5Awrite(type, text, options.type.data());
  H5Aclose(type);
  const hsize_t two = 2;
  const hid_t pair = H5Screate_simple(1, &two, nullptr);
  const hid_t version = H5Acreate2(root, "Version", H5T_STD_I64LE, pair, H5P_DEFAULT, H5P_DEFAULT);
  const std::int64_t one_zero[2] = {1, 0};
  H5Awrite(version, H5T_NATIVE_INT64, one_zero);
  H5Aclose(version);
  const auto nodes = mesh.nodes_m.size(), cells = static_cast<std::size_t>(mesh.tet_count()), ids = mesh.tets.size();
  const auto count = [&](const char* name, std::size_t value) {
    const std::vector<std::int64_t> values(options.pieces, static_cast<std::int64_t>(value));
    write_array(root, name, H5T_STD_I64LE, H5T_NATIVE_INT64, values.data(), {values.size()});
  };
  count("NumberOfPoints", nodes);
  count("NumberOfCells", cells);
  count("NumberOfConnectivityIds", ids);
  write_array(root, "Points", options.single_precision ? H5T_IEEE_F32BE : H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, mesh.nodes_m.data(),
              {nodes, 3}, options.is_chunked);
  write_array(root, "Connectivity", H5T_STD_I64LE, H5T_NATIVE_INT32, mesh.tets.data(), {ids});
  std::vector<std::int64_t> offsets;
  for (std::size_t e = 0; e <= cells; ++e) offsets.push_back(static_cast<std::int64_t>(e) * mesh.nodes_per_tet());
  write_array(root, "Offsets", H5T_STD_I64LE, H5T_NATIVE_INT64, offsets.data(), {offsets.size()});
  const std::vector<std::int32_t> types(cells, mesh.order == 1 ? 10 : 24);
  write_array(root, "Types", H5T_STD_U8LE, H5T_NATIVE_INT32, types.data(), {cells});
  const hid_t cell_data = H5Gcreate2(root, "CellData", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  if (mesh.regions.size() == cells) write_array(cell_data, "region", H5T_STD_I16BE, H5T_NATIVE_INT32, mesh.regions.data(), {cells});
  H5Gclose(cell_data);
  const hid_t point_data = H5Gcreate2(root, "PointData", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  for (const auto& [name, values] : options.point_data)
    write_array(point_data, name.c_str(), H5T_STD_I32LE, H5T_NATIVE_INT32, values.data(), {values.size()});
  H5Gclose(point_data);
  H5Sclose(pair);
  H5Sclose(scalar);
  H5Tclose(text);
  H5Gclose(root);
  H5Fclose(out);
}

}  // namespace carillon::tests
