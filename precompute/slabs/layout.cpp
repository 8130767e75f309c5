// Method: HDF5 1.10 was not written for files of strangers: fuzzed ones crash it. So a child process opens the file and writes down the
//   place, shape and type of each array in lines of text; a child that dies or takes too long makes one InputError. The arrays themselves
//   are read by their places, without HDF5, and every place is checked against the length of the file here.
// Source: VTK file formats, "VTKHDF", version 1.0; HDF5 1.10 reference manual (H5Dget_offset).
// Deviations: chunked, compressed and external arrays are refused, for they have no place to be read from.
#include "precompute/slabs/layout.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <sstream>
#include <stdexcept>

#include "runtime/base/error.hpp"

namespace carillon::slabs {
namespace {

constexpr std::size_t kMostText = 1 << 20;
constexpr int kMostSeconds = 30;
constexpr std::size_t kMostArrays = 1000;  // of PointData or CellData

// ---- in the child ----

struct Refusal : std::runtime_error {
  using std::runtime_error::runtime_error;
};

hid_t require(hid_t id, const std::string& what) {
  if (id < 0) throw Refusal(what + " is missing or cannot be read");
  return id;
}

/// Opens only what lies in this very file: no soft and no external links.
hid_t open_object(hid_t folder, const std::string& name) {
  H5L_info_t info;
  if (H5Lexists(folder, name.c_str(), H5P_DEFAULT) <= 0 || H5Lget_info(folder, name.c_str(), &info, H5P_DEFAULT) < 0)
    throw Refusal(name + " is missing");
  if (info.type != H5L_TYPE_HARD) throw Refusal(name + " is a link");
  return require(H5Oopen(folder, name.c_str(), H5P_DEFAULT), name);
}

hid_t open_dataset(hid_t folder, const std::string& name) {
  const hid_t object = open_object(folder, name);
  if (H5Iget_type(object) != H5I_DATASET) throw Refusal(name + " is no array");
  return object;
}

/// "bytes floating signed big-endian" of the plain types; empty for all others.
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

/// A line "list name offset rows columns bytes floating signed big-endian", the name in hexadecimal; false if it is of no use here.
bool describe_array(hid_t folder, const std::string& name, bool is_required, const char* list, std::string& text) {
  const hid_t data = open_dataset(folder, name);
  const hid_t space = require(H5Dget_space(data), "the shape of " + name);
  const hid_t type = require(H5Dget_type(data), "the type of " + name);
  const hid_t plist = require(H5Dget_create_plist(data), "the layout of " + name);
  const int rank = H5Sget_simple_extent_ndims(space);
  std::array<hsize_t, 2> extent{0, 1};
  if (rank < 1 || rank > 2 || H5Sget_simple_extent_dims(space, extent.data(), nullptr) < 0) {
    if (!is_required) return false;
    throw Refusal(name + " has not one or two dimensions");
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
  if (H5Tget_class(type) != H5T_STRING) throw Refusal("attribute Type of /VTKHDF is no text");
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
    if (info.nlinks > kMostArrays) throw Refusal(fmt::format("{} has {} arrays; at most {} are read", group, info.nlinks, kMostArrays));
    for (hsize_t i = 0; i < info.nlinks; ++i) {
      std::array<char, 256> name{};
      if (H5Lget_name_by_idx(folder, ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(), H5P_DEFAULT) < 0)
        throw Refusal(std::string(group) + " cannot be read");
      describe_array(folder, name.data(), false, list, text);
    }
  }
  return text;
}

void write_all(int to, const std::string& text) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t wrote = ::write(to, text.data() + done, text.size() - done);
    if (wrote <= 0) return;
    done += static_cast<std::size_t>(wrote);
  }
}

[[noreturn]] void run_child(const std::string& path, int to) {
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTERM, SIGINT, SIGXCPU}) signal(number, SIG_DFL);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit none{0, 0}, seconds{kMostSeconds / 2, kMostSeconds / 2};
  setrlimit(RLIMIT_CORE, &none);
  setrlimit(RLIMIT_CPU, &seconds);
  long pages = 0;
  if (FILE* sizes = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(sizes, "%ld", &pages) != 1) pages = 0;
    std::fclose(sizes);
  }
  rlimit memory{};
  getrlimit(RLIMIT_AS, &memory);
  memory.rlim_cur = std::min<rlim_t>(memory.rlim_cur, static_cast<rlim_t>(pages) * sysconf(_SC_PAGESIZE) + (rlim_t{1} << 29));
  if (pages > 0) setrlimit(RLIMIT_AS, &memory);
  const int nowhere = ::open("/dev/null", O_WRONLY);
  ::dup2(nowhere, STDERR_FILENO);
  ::dup2(nowhere, STDOUT_FILENO);
  std::string text;
  try {
    text = describe_file(path) + "end\n";
  } catch (const Refusal& refusal) {
    text = fmt::format("refused {}\n", refusal.what());
  } catch (...) {
    text.clear();
  }
  write_all(to, text);
  _exit(0);
}

// ---- in the parent ----

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw InputError(fmt::format("{}: {}", file.string(), what));
}

/// What the child wrote until it closed the pipe; false if it took too long or wrote too much.
bool read_all(int from, std::string& text) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(kMostSeconds);
  std::array<char, 4096> block;
  while (text.size() < kMostText) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now()).count();
    pollfd wait{from, POLLIN, 0};
    const int ready = left > 0 ? ::poll(&wait, 1, static_cast<int>(left)) : 0;
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return false;
    const ssize_t got = ::read(from, block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return got == 0;
    text.append(block.data(), static_cast<std::size_t>(got));
  }
  return false;
}

std::string ask_child(const std::filesystem::path& file) {
  std::array<int, 2> pipe_ends{};
  if (::pipe2(pipe_ends.data(), O_CLOEXEC) != 0) throw SystemError(fmt::format("{}: no pipe: {}", file.string(), std::strerror(errno)));
  const std::string path = file.string();
  std::fflush(nullptr);  // or the child's copy of the buffers might be written twice
  const pid_t child = ::fork();
  if (child < 0) {
    ::close(pipe_ends[0]);
    ::close(pipe_ends[1]);
    throw SystemError(fmt::format("{}: no second process can be started: {}", file.string(), std::strerror(errno)));
  }
  if (child == 0) {
    ::close(pipe_ends[0]);
    run_child(path, pipe_ends[1]);
  }
  ::close(pipe_ends[1]);
  std::string text;
  const bool is_whole = read_all(pipe_ends[0], text);
  ::close(pipe_ends[0]);
  if (!is_whole) ::kill(child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  if (!is_whole || !WIFEXITED(status) || WEXITSTATUS(status) != 0 || text.empty())
    refuse(file, "its HDF5 structure is damaged (HDF5 fails on it); write it again");
  return text;
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
  std::istringstream lines(ask_child(file));
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

}  // namespace carillon::slabs
