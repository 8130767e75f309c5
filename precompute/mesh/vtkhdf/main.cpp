// carillon-vtkhdf FILE: prints the offset, shape and type of each array of a VTKHDF file, one line each.
//
// Method: HDF5 1.10 is not robust against untrusted files: fuzzed ones crash it. Hence a process of its own with time and memory limits;
//   the reader (precompute/mesh/parallel/layout.cpp) treats a crash as a damaged file. Chunked, compressed and external arrays are refused:
//   they have no file offset.
// Source: VTK file formats, "VTKHDF", version 1.0; HDF5 1.10 reference manual (H5Dget_offset).
#include <fmt/format.h>
#include <hdf5.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/host.hpp"

namespace {

constexpr rlim_t kMaxCpuS = 15;
constexpr rlim_t kMaxBytes = rlim_t{1} << 29;  // on top of the process's initial size
constexpr std::size_t kMaxArrays = 1000;       // of PointData or CellData

struct Refusal : std::runtime_error {
  using std::runtime_error::runtime_error;
};

hid_t require(hid_t id, const std::string& what) {
  if (id < 0) throw Refusal(what + " is missing or cannot be read");
  return id;
}

/// Opens only objects inside this file: no soft or external links.
hid_t open_object(hid_t folder, const std::string& name) {
  H5L_info_t info;
  if (H5Lexists(folder, name.c_str(), H5P_DEFAULT) <= 0 || H5Lget_info(folder, name.c_str(), &info, H5P_DEFAULT) < 0)
    throw Refusal(name + " is missing");
  if (info.type != H5L_TYPE_HARD) throw Refusal(name + " is a link");
  return require(H5Oopen(folder, name.c_str(), H5P_DEFAULT), name);
}

hid_t open_dataset(hid_t folder, const std::string& name) {
  const hid_t object = open_object(folder, name);
  if (H5Iget_type(object) != H5I_DATASET) throw Refusal(name + " is not an array");
  return object;
}

/// "bytes floating signed big-endian" of the plain types; empty for others.
std::string describe_type(hid_t type) {
  const std::array<std::pair<hid_t, const char*>, 20> known{{
      {H5T_IEEE_F32LE, "4 1 1 0"}, {H5T_IEEE_F64LE, "8 1 1 0"}, {H5T_IEEE_F32BE, "4 1 1 1"}, {H5T_IEEE_F64BE, "8 1 1 1"},
      {H5T_STD_I8LE, "1 0 1 0"},   {H5T_STD_I16LE, "2 0 1 0"},  {H5T_STD_I32LE, "4 0 1 0"},  {H5T_STD_I64LE, "8 0 1 0"},
      {H5T_STD_U8LE, "1 0 0 0"},   {H5T_STD_U16LE, "2 0 0 0"},  {H5T_STD_U32LE, "4 0 0 0"},  {H5T_STD_U64LE, "8 0 0 0"},
      {H5T_STD_I8BE, "1 0 1 1"},   {H5T_STD_I16BE, "2 0 1 1"},  {H5T_STD_I32BE, "4 0 1 1"},  {H5T_STD_I64BE, "8 0 1 1"},
      {H5T_STD_U8BE, "1 0 0 1"},   {H5T_STD_U16BE, "2 0 0 1"},  {H5T_STD_U32BE, "4 0 0 1"},  {H5T_STD_U64BE, "8 0 0 1"},
  }};
  for (const auto& [one, words] : known)
    if (H5Tequal(type, one) > 0) return words;
  return {};
}

/// Line "list name offset rows columns bytes floating signed big-endian", name in hexadecimal; false if the array is not usable.
bool describe_array(hid_t folder, const std::string& name, bool is_required, const char* list, std::string& text) {
  const hid_t data = open_dataset(folder, name);
  const hid_t space = require(H5Dget_space(data), "the shape of " + name);
  const hid_t type = require(H5Dget_type(data), "the type of " + name);
  const hid_t plist = require(H5Dget_create_plist(data), "the layout of " + name);
  const int rank = H5Sget_simple_extent_ndims(space);
  std::array<hsize_t, 2> extent{0, 1};
  if (rank < 1 || rank > 2 || H5Sget_simple_extent_dims(space, extent.data(), nullptr) < 0) {
    if (!is_required) return false;
    throw Refusal(name + " does not have one or two dimensions");
  }
  const std::string words = describe_type(type);
  if (words.empty()) {
    if (!is_required) return false;
    throw Refusal(name + " does not hold plain numbers");
  }
  if (!is_required && (words[2] == '1' || extent[1] != 1)) return false;
  if (H5Pget_layout(plist) != H5D_CONTIGUOUS || H5Pget_external_count(plist) > 0)
    throw Refusal(name + " is chunked or compressed; make it contiguous with: h5repack -l CONTI -f NONE OLD NEW");
  const haddr_t offset = H5Dget_offset(data);
  if (offset == HADDR_UNDEF && extent[0] > 0) throw Refusal(name + " was never written");
  std::string hex;
  for (const unsigned char c : name) hex += fmt::format("{:02x}", c);
  text += fmt::format("{} {} {} {} {} {}\n", list, hex, offset == HADDR_UNDEF ? 0 : offset, extent[0], extent[1], words);
  H5Pclose(plist);
  H5Tclose(type);
  H5Sclose(space);
  H5Dclose(data);
  return true;
}

std::int64_t read_count(hid_t folder, const char* name) {
  const hid_t data = open_dataset(folder, name);
  const hid_t space = require(H5Dget_space(data), name);
  const hssize_t pieces = H5Sget_simple_extent_npoints(space);
  if (pieces != 1)
    throw Refusal(fmt::format("{} has {} entries: the mesh is in {} pieces; join them, common nodes once, and write one piece", name,
                              pieces, pieces));
  long long value = 0;
  if (H5Dread(data, H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, &value) < 0) throw Refusal(std::string(name) + " cannot be read");
  return value;
}

void check_type(hid_t root) {
  const hid_t attribute = require(H5Aopen(root, "Type", H5P_DEFAULT), "attribute Type of /VTKHDF");
  const hid_t type = require(H5Aget_type(attribute), "attribute Type of /VTKHDF");
  if (H5Tget_class(type) != H5T_STRING) throw Refusal("attribute Type of /VTKHDF is not text");
  std::string text;
  if (H5Tis_variable_str(type) > 0) {
    char* read = nullptr;
    if (H5Aread(attribute, type, &read) >= 0 && read != nullptr) text = read;
  } else {
    std::vector<char> read(H5Tget_size(type) + 1, '\0');
    if (H5Aread(attribute, type, read.data()) >= 0) text = read.data();
  }
  if (text != "UnstructuredGrid") throw Refusal(fmt::format("/VTKHDF is of type '{}'; only UnstructuredGrid is a mesh", text));
}

std::string describe_file(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file < 0) throw Refusal("it begins as HDF5 but cannot be opened as such; write it again");
  const hid_t root = open_object(file, "VTKHDF");
  check_type(root);
  std::string text = fmt::format("counts {} {} {}\n", read_count(root, "NumberOfPoints"), read_count(root, "NumberOfCells"),
                                 read_count(root, "NumberOfConnectivityIds"));
  describe_array(root, "Points", true, "points", text);
  describe_array(root, "Connectivity", true, "connectivity", text);
  describe_array(root, "Offsets", true, "offsets", text);
  describe_array(root, "Types", true, "types", text);
  for (const auto& [group, list] : {std::pair("PointData", "point_data"), std::pair("CellData", "cell_data")}) {
    if (H5Lexists(root, group, H5P_DEFAULT) <= 0) continue;
    const hid_t folder = open_object(root, group);
    H5G_info_t info;
    if (H5Gget_info(folder, &info) < 0) throw Refusal(std::string(group) + " cannot be read");
    if (info.nlinks > kMaxArrays) throw Refusal(fmt::format("{} has {} arrays; at most {} are read", group, info.nlinks, kMaxArrays));
    for (hsize_t i = 0; i < info.nlinks; ++i) {
      std::array<char, 256> name{};
      if (H5Lget_name_by_idx(folder, ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(), H5P_DEFAULT) < 0)
        throw Refusal(std::string(group) + " cannot be read");
      describe_array(folder, name.data(), false, list, text);
    }
  }
  return text;
}

/// Limits time and memory and disables core files.
void limit_process() {
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU}) ::signal(number, SIG_DFL);
  const rlimit none{0, 0}, seconds{kMaxCpuS, kMaxCpuS};
  ::setrlimit(RLIMIT_CORE, &none);
  ::setrlimit(RLIMIT_CPU, &seconds);
  rlimit memory{};
  ::getrlimit(RLIMIT_AS, &memory);
  const auto taken = static_cast<rlim_t>(carillon::base::find_memory().address_space);
  memory.rlim_cur = std::min<rlim_t>(memory.rlim_cur, taken + kMaxBytes);
  if (taken > 0) ::setrlimit(RLIMIT_AS, &memory);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    limit_process();
    fmt::print("{}end\n", describe_file(argv[1]));
  } catch (const Refusal& refusal) {
    fmt::print("refused {}\n", refusal.what());
  } catch (const std::exception&) {
    return 1;
  }
  std::fflush(stdout);
  ::_Exit(0);  // skip HDF5 cleanup, which a damaged file could break
}
